"""HTTP request handler of the page server."""

import ipaddress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any
from urllib.parse import urlsplit

from drivers.screen.server import MAX_LISTENERS, REQUEST_TIMEOUT, PageTcpServer

NEWS_INTERVAL = 1 / 30
"""Seconds between two checks whether the content of a page has changed."""

HEARTBEAT_POLLS = 30
"""Number of checks without a change after which the last content is sent again, as a heartbeat for the page."""

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; "
    "frame-ancestors 'none'"
)
"""Content security policy: scripts, styles and connections only from this server."""


class PageRequestHandler(BaseHTTPRequestHandler):
    """Handles one request of a browser, on a thread of the server."""

    server: PageTcpServer
    server_version = "MissionTree"
    sys_version = ""
    timeout = REQUEST_TIMEOUT

    def do_GET(self) -> None:
        """Send the document at the requested path, or stream the events of the page."""
        if not _is_numeric_host(self.headers.get("Host", "")):
            self.send_error(HTTPStatus.FORBIDDEN, "use localhost, or a numeric address")
            return
        path = urlsplit(self.path).path
        if path == self.server.events and self._is_cross_site():
            self.send_error(HTTPStatus.FORBIDDEN, "only the page that is served here may listen")
        elif path == self.server.events:
            self._stream_news()
        elif path in self.server.site:
            document = self.server.site[path]()
            self._send_headers(f"{document.kind}; charset=utf-8")
            self.wfile.write(document.text.encode())
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def log_message(self, *args: Any) -> None:
        """Log nothing: the terminal belongs to the mission."""

    def _is_cross_site(self) -> bool:
        """True if the request comes from a page of another server.

        Browsers say so in the header ``Sec-Fetch-Site``, old ones in ``Origin``.
        """
        if self.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            return True
        origin = self.headers.get("Origin")
        return origin is not None and origin != f"http://{self.headers['Host']}"

    def _send_headers(self, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", CONTENT_SECURITY_POLICY)
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def _stream_news(self) -> None:
        """Stream the server's events to a page as long as it listens, including the last one when the server closes."""
        talks = self.server.connections
        if not talks.listen(self.request, self.client_address[0]):
            self.send_error(HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_LISTENERS} pages are listening already")
            return
        try:
            self._send_headers("text/event-stream")
            self.wfile.write(b"retry: 1000\n\n")
            told, quiet, last = "", 0, False
            while not last:
                last = self.server.end_requested.wait(NEWS_INTERVAL)
                news, quiet = self.server.news(), quiet + 1
                if news != told or quiet >= HEARTBEAT_POLLS:
                    self.wfile.write(f"data: {news}\n\n".encode())
                    told, quiet = news, 0
        finally:
            with talks.lock:
                talks.listeners.pop(self.request, None)


def _is_numeric_host(host: str) -> bool:
    """True if a Host header names this computer as ``localhost`` or by a numeric address."""
    if "@" in host:  # before it: a user, allowed in URLs but not in Host headers
        return False
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or bool(ipaddress.ip_address(name))
    except ValueError:
        return False
