"""Notices to a web server: one POST of JSON for each."""

import socket
from collections.abc import Mapping
from contextlib import closing, suppress
from functools import partial
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from threading import Lock, Timer
from types import TracebackType
from typing import Any, Self
from urllib.error import HTTPError, URLError
from urllib.request import HTTPHandler, HTTPRedirectHandler, HTTPSHandler, Request, build_opener

from config.notices import WebhookNotice, site_of
from missions.plugins.tasks.notice import DeliveryError, Notice, read_secret

# A deadline for a talk with a server: a time-out for each read alone lets one go on for ever that sends little.


class Deadline:
    """While it is entered, cuts the sockets that it ``watch_socket`` when ``seconds`` have passed; then it is ``expired``."""

    def __init__(self, seconds: float) -> None:
        self.expired = False
        self._lock = Lock()
        self._sockets: list[socket.socket] = []
        self._timer = Timer(seconds, self._shut_down)
        self._timer.daemon = True

    def __enter__(self) -> Self:
        self._timer.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._timer.cancel()
        self._timer.join()
        for each in self._sockets:
            each.close()

    def watch_socket(self, connection: socket.socket) -> None:
        """Cut this one too, whatever is wrapped around it later; at once where the time is over."""
        with self._lock:
            self._sockets.append(connection.dup())
        if self.expired:
            self._shut_down()

    def _shut_down(self) -> None:
        with self._lock:
            self.expired = True
            for each in self._sockets:
                with suppress(OSError):  # it has ended
                    each.shutdown(socket.SHUT_RDWR)


TIMEOUT = 10.0
"""Seconds that it may take altogether, however slowly the server goes on."""


class WebhookChannel:
    """Posts each notice; the server has taken it when it answers 2xx.

    The header ``Idempotency-Key`` holds the notice's id, which is also in the JSON: so the server can drop doubles.
    A redirection is no delivery: a POST that follows one becomes a GET without its text. What is told of errors has
    the scheme and the host of its address alone: for many services the rest is a secret.
    """

    def __init__(self, config: WebhookNotice, environment: Mapping[str, str], timeout: float = TIMEOUT) -> None:
        self._config, self._environment, self._timeout = config, environment, timeout

    def __call__(self, notice: Notice) -> None:
        """Post it once. Raises NotTaken for any other answer, and none."""
        url, site = self._address()
        headers = {"Content-Type": "application/json", "Idempotency-Key": notice.id}
        headers |= {name: read_secret(value, self._environment) for name, value in self._config.headers.items()}
        request = Request(url, notice.as_json().encode(), headers, method="POST")  # noqa: S310 - http(s), as read
        late = f"did not answer within {self._timeout:g} s"
        with Deadline(self._timeout) as deadline:
            try:
                opener = build_opener(_NoRedirect, _Http(deadline), _Https(deadline))
                with closing(opener.open(request, timeout=self._timeout)):
                    if not deadline.expired:  # the end of its headers came from them, not from us
                        return
                problem = ""
            except HTTPError as error:
                error.close()
                problem = f"the server says {error.code} {error.reason}"
            except URLError as error:
                # The connection's own limit may be heard before the deadline's, which is on another thread.
                problem = late if isinstance(error.reason, TimeoutError) else f"cannot be reached: {error.reason}"
            except ValueError:  # whose text has what it is about
                problem = "a value of its headers has a letter that none may have"
            except TimeoutError:
                problem = late
            except (HTTPException, OSError) as error:
                problem = str(error) or type(error).__name__
            if deadline.expired:
                problem = late
        path = url.removeprefix(site)
        raise DeliveryError(f"{site}: {problem.replace(path, '...') if len(path) > 1 else problem}")

    def _address(self) -> tuple[str, str]:
        """Return the whole address, and what of it may be told."""
        variable = self._config.url_from
        url = read_secret(variable, self._environment).strip() if variable else self._config.url
        try:
            return url, site_of(url)
        except ValueError:
            raise DeliveryError(f"the environment variable {variable} holds no address of a web server") from None


class _NoRedirect(HTTPRedirectHandler):
    """Follows no redirection: each is an error then."""

    def redirect_request(self, *_: object, **__: object) -> None:
        """Return no request."""


class _Connection(HTTPConnection):
    """A connection that a deadline ends."""

    deadline: Deadline

    def connect(self) -> None:
        """Connect, and have it ended in time: from here on, also while TLS is negotiated."""
        super().connect()
        self.deadline.watch_socket(self.sock)


class _SecureConnection(HTTPSConnection, _Connection):
    """The same with TLS: HTTPSConnection connects by way of its neighbour here."""


def _make_connection(kind: type[_Connection], deadline: Deadline, host: str, **options: Any) -> _Connection:
    connection = kind(host, **options)
    connection.deadline = deadline
    return connection


class _Http(HTTPHandler):
    def __init__(self, deadline: Deadline) -> None:
        super().__init__()
        self._connected = partial(_make_connection, _Connection, deadline)

    def http_open(self, req: Request) -> HTTPResponse:
        """Connect with a deadline."""
        return self.do_open(self._connected, req)


class _Https(HTTPSHandler):
    def __init__(self, deadline: Deadline) -> None:
        super().__init__()
        self._connected = partial(_make_connection, _SecureConnection, deadline)

    def https_open(self, req: Request) -> HTTPResponse:
        """Connect with a deadline."""
        return self.do_open(self._connected, req)
