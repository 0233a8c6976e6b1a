"""A small HTTP server: documents, and news that a page receives as server-sent events.

It is for browsers on the robot itself. It answers only GET, and only requests for ``localhost`` or a numeric address: a
foreign page whose host name points to this computer (DNS rebinding) requests that name. No foreign page may listen,
embed the documents, or frame them.
"""

import logging
import socket
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import field
from socketserver import BaseRequestHandler, ThreadingTCPServer
from threading import Event, Lock, Thread
from typing import Any

from drivers.api.fast_dataclass import dataclass
from drivers.clock import SystemClock

EVENTS = "/events"
MAX_CONNECTIONS = 32
"""Maximum simultaneous connections, including listeners. A further one closes the oldest without an answer."""

MAX_LISTENERS = 4
"""Maximum pages that listen at once."""

REQUEST_TIMEOUT = 5.0
"""Seconds for a request and its answer, at any speed of the browser."""

RETRY_INTERVAL = 0.1
"""Seconds without accepting connections after the process ran out of descriptors."""

CLOSE_TIMEOUT = 0.2
"""Seconds that all connections together have for their last news."""


@dataclass(frozen=True, slots=True)
class Document:
    """Document that the server sends: its content type, such as ``text/html``, and its text."""

    kind: str
    text: str


SiteMap = Mapping[str, Callable[[], Document]]
"""Documents of a server by path."""


@dataclass(slots=True)
class Connections:
    """Open connections of the page server, with their threads."""

    lock: Lock = field(default_factory=Lock)
    sockets: dict[socket.socket, Thread] = field(default_factory=dict)
    deadlines: dict[socket.socket, float] = field(default_factory=dict)
    """Deadline of each answer; listeners have none."""

    listeners: dict[socket.socket, str] = field(default_factory=dict)
    """Address of each listener."""

    def listen(self, request: socket.socket, address: str) -> bool:
        """Register a listener; return True if there is room.

        If its address has fewer listeners than another one, the oldest of that one is closed to make room.
        """
        with self.lock:
            if len(self.listeners) >= MAX_LISTENERS:
                [(busiest, count)] = Counter(self.listeners.values()).most_common(1)
                if list(self.listeners.values()).count(address) + 1 >= count:
                    return False
                oldest = next(each for each, where in self.listeners.items() if where == busiest)
                del self.listeners[oldest]
                _shut_down(oldest)
            self.listeners[request] = address
            self.deadlines.pop(request, None)
            return True


class PageServer:
    """Serves ``site`` and, at ``events``, the result of ``news``, one line, whenever it changes.

    ``news`` and the site are called on the server's threads. A slow listener misses intermediate news. Opens no port
    before ``open``.
    """

    def __init__(self, site: SiteMap, news: Callable[[], str], events: str = EVENTS) -> None:
        self._site = site
        self._news = news
        self._events = events
        self._server: PageTcpServer | None = None
        self._thread: Thread | None = None

    @property
    def address(self) -> str:
        """URL of the server; empty while it is closed."""
        if self._server is None:
            return ""
        host, port = self._server.server_address[:2]
        return f"http://{host!s}:{port}/"

    @property
    def listeners(self) -> int:
        """Number of listening pages."""
        return 0 if self._server is None else len(self._server.connections.listeners)

    def open(self, host: str, port: int) -> None:
        """Serve at this port, 0 for any free one. Raises OSError if that is not possible."""
        self._server = PageTcpServer((host, port), self._site, self._news, self._events)
        self._thread = Thread(target=self._server.serve_forever, args=(0.1,), name="page server", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Send the last news, close all connections, and free the port. Safe more than once."""
        server, self._server = self._server, None
        if server is None or self._thread is None:
            return
        server.end_requested.set()
        server.shutdown()
        self._thread.join()
        server.server_close()
        server.close_connections()


class PageTcpServer(ThreadingTCPServer):
    """Accepts connections, and gives each a thread that ends with ``close_connections``."""

    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, at: tuple[str, int], site: SiteMap, news: Callable[[], str], events: str) -> None:
        self.site, self.news, self.events = site, news, events
        self.clock = SystemClock()
        self.end_requested = Event()
        self.connections = Connections()
        super().__init__(at, BaseRequestHandler)

    def get_request(self) -> tuple[Any, Any]:
        """Accept a connection. Without a free descriptor, wait for a moment: the socket stays ready all the time."""
        try:
            return super().get_request()
        except OSError:
            self.end_requested.wait(RETRY_INTERVAL)
            raise

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Return True if there is room for a connection; the oldest without an answer is closed for it."""
        del request, client_address
        with self.connections.lock:
            oldest = (
                next(iter(self.connections.deadlines), None)
                if len(self.connections.sockets) >= MAX_CONNECTIONS
                else None
            )
            thread = None if oldest is None else self.connections.sockets.get(oldest)
            if oldest is not None:
                del self.connections.deadlines[oldest]
                _shut_down(oldest)
        if thread is not None:
            thread.join(CLOSE_TIMEOUT)
        with self.connections.lock:
            return len(self.connections.sockets) < MAX_CONNECTIONS

    def service_actions(self) -> None:
        """Close connections after their deadline; called ten times a second."""
        now = self.clock.now()
        with self.connections.lock:
            for request in [each for each, due in self.connections.deadlines.items() if due < now]:
                del self.connections.deadlines[request]
                _shut_down(request)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a request on a registered thread."""
        thread = Thread(
            target=self.process_request_thread, args=(request, client_address), name="page talk", daemon=True
        )
        with self.connections.lock:
            self.connections.sockets[request] = thread
            self.connections.deadlines[request] = self.clock.now() + REQUEST_TIMEOUT
        thread.start()

    def finish_request(self, request: Any, client_address: Any) -> None:
        """Answer. The HTTP modules are imported for the first browser: they take longer than the rest of a screen."""
        from drivers.screen.request_handler import PageRequestHandler  # noqa: PLC0415 - most runs are looked at by none

        PageRequestHandler(request, client_address, self)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection, and unregister it."""
        super().shutdown_request(request)
        with self.connections.lock:
            self.connections.sockets.pop(request, None)
            self.connections.deadlines.pop(request, None)

    def handle_error(self, *args: Any) -> None:
        """Log our own errors; a browser that disconnects during an answer is none."""
        del args
        if not isinstance(sys.exception(), OSError):
            logging.getLogger(__name__).exception("a page was not answered")

    def close_connections(self) -> None:
        """Close all connections, with a moment for the last news."""
        with self.connections.lock:
            talks = dict(self.connections.sockets)
        clock = SystemClock()
        for thread in talks.values():
            thread.join(max(0.0, CLOSE_TIMEOUT - clock.now()))
        for request in talks:
            _shut_down(request)
        for thread in talks.values():
            thread.join()


def _shut_down(request: socket.socket) -> None:
    with suppress(OSError):  # it has ended
        request.shutdown(socket.SHUT_RDWR)
