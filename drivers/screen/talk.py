"""What a browser is answered by the server of pages, in HTTP."""

import ipaddress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from typing import Any
from urllib.parse import urlsplit

from drivers.screen.server import LISTENERS, REQUEST_TIMEOUT, Server

PERIOD = 1 / 30
"""Seconds between two looks for news."""

BEAT = 30
"""Looks without news after which the last is sent again: the page knows that the robot still runs."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; base-uri 'none'; "
    "frame-ancestors 'none'"
)
"""What a page may do: run and look as it was served here, ask here, and nothing else."""


class Talk(BaseHTTPRequestHandler):
    """Answers one request of a browser, on a thread of the server's."""

    server: Server
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
        if not talks.listen(self.request, self.client_address[0]):
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
                talks.listeners.pop(self.request, None)


def _named_by_figures(host: str) -> bool:
    """Whether a Host header names this computer as ``localhost``, or by an address in figures."""
    if "@" in host:  # before it stands a user, whom URLs may have, and Host headers never
        return False
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return name == "localhost" or bool(ipaddress.ip_address(name))
    except ValueError:
        return False
