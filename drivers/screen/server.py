"""Small HTTP server for documents and server-sent events, for browsers on the robot itself.

It answers only GET requests for ``localhost`` or a numeric address. A foreign page whose host name points to this
computer (DNS rebinding) has another host name in its request, so it is refused. No page of another server may listen to
the events, embed the documents, or show them in a frame.
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
"""Maximum number of open connections, including listeners.

A further connection closes the oldest one whose request was not answered yet.
"""

MAX_LISTENERS = 4
"""Maximum number of pages that listen to the events at the same time."""

REQUEST_TIMEOUT = 5.0
"""Seconds in which a request must arrive and be answered; a connection with a slower browser is closed."""

RETRY_INTERVAL = 0.1
"""Seconds for which no connection is accepted after the process ran out of file descriptors."""

CLOSE_TIMEOUT = 0.2
"""Seconds that all connections together have to send their last event before they are closed."""


@dataclass(frozen=True, slots=True)
class Document:
    """Document that the server sends: its content type, such as ``text/html``, and its text."""

    kind: str
    text: str


SiteMap = Mapping[str, Callable[[], Document]]
"""Documents of a server by path: functions that return the current document."""


@dataclass(slots=True)
class Connections:
    """Open connections of the page server: ``sockets`` has the thread that serves each one."""

    lock: Lock = field(default_factory=Lock)
    sockets: dict[socket.socket, Thread] = field(default_factory=dict)
    deadlines: dict[socket.socket, float] = field(default_factory=dict)
    """Time by which each connection must be answered. Listeners to events have no deadline."""

    listeners: dict[socket.socket, str] = field(default_factory=dict)
    """Client address of each listener to events."""

    def listen(self, request: socket.socket, address: str) -> bool:
        """Register a listener to events; return False if there are too many.

        If another client address has more listeners than ``address``, its oldest one is closed to make room.
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
    """HTTP server for the documents in ``site``, and for events at the path ``events``.

    An event is sent whenever the result of ``news``, one line, changes. A slow listener misses intermediate ones. The
    functions are called on the server's threads. The port is opened by ``open``.
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
        """Serve the documents at ``port``, 0 for any free port. Raises OSError if the port cannot be opened."""
        self._server = PageTcpServer((host, port), self._site, self._news, self._events)
        self._thread = Thread(target=self._server.serve_forever, args=(0.1,), name="page server", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Send the last event to the listeners, close all connections, and free the port. Safe more than once."""
        server, self._server = self._server, None
        if server is None or self._thread is None:
            return
        server.end_requested.set()
        server.shutdown()
        self._thread.join()
        server.server_close()
        server.close_connections()


class PageTcpServer(ThreadingTCPServer):
    """TCP server of a page: answers each connection on a thread, until ``close_connections`` is called."""

    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, at: tuple[str, int], site: SiteMap, news: Callable[[], str], events: str) -> None:
        self.site, self.news, self.events = site, news, events
        self.clock = SystemClock()
        self.end_requested = Event()
        self.connections = Connections()
        super().__init__(at, BaseRequestHandler)

    def get_request(self) -> tuple[Any, Any]:
        """Accept a connection. If no file descriptor is free, wait for ``RETRY_INTERVAL`` and raise OSError."""
        try:
            return super().get_request()
        except OSError:
            self.end_requested.wait(RETRY_INTERVAL)
            raise

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Return True if there is room for a connection.

        If there is none, the oldest connection whose request was not answered yet is closed.
        """
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
        """Answer a request on a new thread. ``connections`` stores the thread and the time by which it must answer."""
        thread = Thread(
            target=self.process_request_thread, args=(request, client_address), name="page talk", daemon=True
        )
        with self.connections.lock:
            self.connections.sockets[request] = thread
            self.connections.deadlines[request] = self.clock.now() + REQUEST_TIMEOUT
        thread.start()

    def finish_request(self, request: Any, client_address: Any) -> None:
        """Answer a request. The HTTP modules are imported only now, since few screens are ever opened in a browser."""
        from drivers.screen.request_handler import PageRequestHandler  # noqa: PLC0415 - most runs are looked at by none

        PageRequestHandler(request, client_address, self)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection, and unregister it."""
        super().shutdown_request(request)
        with self.connections.lock:
            self.connections.sockets.pop(request, None)
            self.connections.deadlines.pop(request, None)

    def handle_error(self, *args: Any) -> None:
        """Log an exception of our own code; ignore one because a browser has disconnected."""
        del args
        if not isinstance(sys.exception(), OSError):
            logging.getLogger(__name__).exception("a page was not answered")

    def close_connections(self) -> None:
        """Close all connections after ``CLOSE_TIMEOUT``, in which they can send the last event."""
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
