"""A server on another port of this computer: to a browser it has the studio's host name, and gets its cookies."""

from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread


class Neighbour:
    """The ``cookies`` that browsers have sent to it, and the ``page`` that it shows them."""

    def __init__(self) -> None:
        self.cookies: list[str] = []
        self.page = "<!doctype html><title>beside</title>"
        self.port = 0

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/"


@contextmanager
def neighbour() -> Iterator[Neighbour]:
    """Serve one until this is over."""
    found = Neighbour()

    class Answers(BaseHTTPRequestHandler):
        timeout = 0.5  # browsers open connections before they need them

        def do_GET(self) -> None:
            found.cookies += self.headers.get_all("Cookie", [])
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            self.wfile.write(found.page.encode())

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Answers)
    server.daemon_threads = False  # so that `server_close` waits for them
    found.port = server.server_address[1]
    thread = Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    try:
        yield found
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
