"""A small server of pages: documents, and news that is sent to a page as it comes (server-sent events).

It is for browsers on the robot itself. It answers GET alone, and only who asks for ``localhost`` or for an address in
figures: a page from elsewhere whose name has been pointed at this computer (DNS rebinding) asks for that name. No page
from elsewhere may listen, show what is served here as its own, or frame it.
"""

import ipaddress
import logging
import socket
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from socketserver import ThreadingTCPServer
from threading import Event, Lock, Thread
from typing import Any
from urllib.parse import urlsplit

from drivers.api.quick import dataclass
from drivers.clock import SystemClock

EVENTS = "/events"
PERIOD = 1 / 30
"""Seconds between two looks for news."""

BEAT = 30
"""Looks without news after which the last is sent again: the page knows that the robot still runs."""

LISTENERS = 4
"""Pages that may listen at once."""

TALKS = 32
"""Browsers that are talked with at once, with those that listen: more are hung up on."""

REQUEST_TIMEOUT = 5.0
"""Seconds that a browser has to ask, and to take what it is sent, however slowly it goes on."""

FAREWELL = 0.2
"""Seconds that all talks together have for their last words."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; "
    "frame-ancestors 'none'"
)
"""What a page may do: run and look as it was served here, ask here, and nothing else."""


@dataclass(frozen=True, slots=True)
class Document:
    """Something to be fetched: its type, as ``text/html``, and its text."""

    kind: str
    text: str


Site = Mapping[str, Callable[[], Document]]
"""What there is at each path."""


@dataclass(slots=True)
class _Talks:
    """Who is being answered now."""

    lock: Lock = field(default_factory=Lock)
    sockets: dict[socket.socket, Thread] = field(default_factory=dict)
    due: dict[socket.socket, float] = field(default_factory=dict)
    """When each has to have its answer; one that listens has time."""

    listeners: int = 0


class PageServer:
    """Serves ``site`` and, at ``events``, what ``news`` returns, whenever it has changed; news are one line each.

    ``news`` and the site are asked from the server's own threads. A listener that is slow misses what was replaced
    meanwhile. Opens nothing before ``open``.
    """

    def __init__(self, site: Site, news: Callable[[], str], events: str = EVENTS) -> None:
        self._site = site
        self._news = news
        self._events = events
        self._server: _Server | None = None
        self._thread: Thread | None = None

    @property
    def address(self) -> str:
        """Where to look; empty while it is closed."""
        if self._server is None:
            return ""
        host, port = self._server.server_address[:2]
        return f"http://{host!s}:{port}/"

    @property
    def listeners(self) -> int:
        """How many pages listen."""
        return 0 if self._server is None else self._server.talks.listeners

    def open(self, host: str, port: int) -> None:
        """Serve at this port, 0 for any that is free. Raises OSError where that is not possible."""
        self._server = _Server((host, port), self._site, self._news, self._events)
        self._thread = Thread(target=self._server.serve_forever, args=(0.1,), name="page server", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Send the last news, end all talks, and free the port. Safe more than once."""
        server, self._server = self._server, None
        if server is None or self._thread is None:
            return
        server.ending.set()
        server.shutdown()
        self._thread.join()
        server.server_close()
        server.hang_up()


class _Server(ThreadingTCPServer):
    """Accepts, and gives each browser a thread that ends with ``hang_up``."""

    allow_reuse_address = True
    daemon_threads = True

    def __init__(self, at: tuple[str, int], site: Site, news: Callable[[], str], events: str) -> None:
        self.site, self.news, self.events = site, news, events
        self.clock = SystemClock()
        self.ending = Event()
        self.talks = _Talks()
        super().__init__(at, _Talk)

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Say whether there is room for one more."""
        del request, client_address
        with self.talks.lock:
            return len(self.talks.sockets) < TALKS

    def service_actions(self) -> None:
        """Hang up on those whose time is over; asked ten times a second."""
        now = self.clock.now()
        with self.talks.lock:
            for request in [each for each, due in self.talks.due.items() if due < now]:
                del self.talks.due[request]
                _cut(request)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer on a thread, which is remembered."""
        thread = Thread(
            target=self.process_request_thread, args=(request, client_address), name="page talk", daemon=True
        )
        with self.talks.lock:
            self.talks.sockets[request] = thread
            self.talks.due[request] = self.clock.now() + REQUEST_TIMEOUT
        thread.start()

    def shutdown_request(self, request: Any) -> None:
        """Close a talk, and forget it."""
        super().shutdown_request(request)
        with self.talks.lock:
            self.talks.sockets.pop(request, None)
            self.talks.due.pop(request, None)

    def handle_error(self, *args: Any) -> None:
        """Log what is our own mistake; a browser that goes away in the middle of a talk is nobody's."""
        del args
        if not isinstance(sys.exception(), OSError):
            logging.getLogger(__name__).exception("a page was not answered")

    def hang_up(self) -> None:
        """End all talks: they have a moment for their last words, and are cut off then."""
        with self.talks.lock:
            talks = dict(self.talks.sockets)
        clock = SystemClock()
        for thread in talks.values():
            thread.join(max(0.0, FAREWELL - clock.now()))
        for request in talks:
            _cut(request)
        for thread in talks.values():
            thread.join()


def _cut(request: socket.socket) -> None:
    with suppress(OSError):  # it has ended
        request.shutdown(socket.SHUT_RDWR)


class _Talk(BaseHTTPRequestHandler):
    """Answers one request."""

    server: _Server
    server_version = "MissionTree"
    sys_version = ""
    timeout = REQUEST_TIMEOUT

    def do_GET(self) -> None:
        """Send a document or the news."""
        if not _named_by_figures(self.headers.get("Host", "")):
            self.send_error(HTTPStatus.FORBIDDEN, "ask for localhost, or for an address in figures")
            return
        path = urlsplit(self.path).path
        if path == self.server.events and self._from_elsewhere():
            self.send_error(HTTPStatus.FORBIDDEN, "only the page that is served here may listen")
        elif path == self.server.events:
            self._tell()
        elif path in self.server.site:
            document = self.server.site[path]()
            self._begin(f"{document.kind}; charset=utf-8")
            self.wfile.write(document.text.encode())
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def log_message(self, *args: Any) -> None:
        """Say nothing: the terminal belongs to the mission."""

    def _from_elsewhere(self) -> bool:
        """Whether a page of another server asks: browsers tell by ``Sec-Fetch-Site``, old ones by ``Origin`` alone."""
        if self.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            return True
        origin = self.headers.get("Origin")
        return origin is not None and origin != f"http://{self.headers['Host']}"

    def _begin(self, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def _tell(self) -> None:
        """Send the news as they come, as long as the page listens; the last ones at the end too."""
        talks = self.server.talks
        with talks.lock:
            free = talks.listeners < LISTENERS
            talks.listeners += free
            if free:
                talks.due.pop(self.request, None)
        if not free:
            self.send_error(HTTPStatus.SERVICE_UNAVAILABLE, f"{LISTENERS} pages listen already")
            return
        try:
            self._begin("text/event-stream")
            self.wfile.write(b"retry: 1000\n\n")
            told, quiet, last = "", 0, False
            while not last:
                last = self.server.ending.wait(PERIOD)
                news, quiet = self.server.news(), quiet + 1
                if news != told or quiet >= BEAT:
                    self.wfile.write(f"data: {news}\n\n".encode())
                    told, quiet = news, 0
        finally:
            with talks.lock:
                talks.listeners -= 1


def _named_by_figures(host: str) -> bool:
    """Whether a Host header names this computer as ``localhost``, or by an address in figures."""
    if "@" in host:  # before it stands a user, whom URLs may have, and Host headers never
        return False
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or bool(ipaddress.ip_address(name))
    except ValueError:
        return False
