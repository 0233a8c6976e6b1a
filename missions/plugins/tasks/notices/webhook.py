"""Notice channel: an HTTP POST of JSON for each notice."""

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

# Deadline of a whole exchange with a server: a timeout for each read would let a slow sender go on for ever.


class Deadline:
    """Shuts down watched sockets after ``seconds``, while the context is entered; ``expired`` is True from then on."""

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
        """Shut down this socket too when the deadline expires, even after it was wrapped in TLS.

        If the deadline has expired already, shut the socket down at once.
        """
        with self._lock:
            self._sockets.append(connection.dup())
        if self.expired:
            self._shut_down()

    def _shut_down(self) -> None:
        with self._lock:
            self.expired = True
            for each in self._sockets:
                with suppress(OSError):  # already closed
                    each.shutdown(socket.SHUT_RDWR)


TIMEOUT = 10.0
"""Maximum total duration of a request in seconds, even if the server sends slowly."""


class WebhookChannel:
    """Posts each notice to a web server; a status of 2xx means delivered.

    The header ``Idempotency-Key`` has the notice's id, so the server can drop duplicates. Redirections are errors,
    since a redirected POST becomes a GET without body. Error messages contain only scheme, host and port, because the
    rest of the address is often a secret.
    """

    def __init__(self, config: WebhookNotice, environment: Mapping[str, str], timeout: float = TIMEOUT) -> None:
        self._config, self._environment, self._timeout = config, environment, timeout

    def __call__(self, notice: Notice) -> None:
        """Post a notice. Raises DeliveryError for any status except 2xx, and if the server does not answer."""
        url, site = self._address()
        headers = {"Content-Type": "application/json", "Idempotency-Key": notice.id}
        headers |= {name: read_secret(value, self._environment) for name, value in self._config.headers.items()}
        request = Request(url, notice.as_json().encode(), headers, method="POST")  # noqa: S310 - http(s), as read
        late = f"no reply within {self._timeout:g} s"
        with Deadline(self._timeout) as deadline:
            try:
                opener = build_opener(_NoRedirect, _Http(deadline), _Https(deadline))
                with closing(opener.open(request, timeout=self._timeout)):
                    if not deadline.expired:  # the server closed the connection, not the deadline
                        return
                problem = ""
            except HTTPError as error:
                error.close()
                problem = f"the server says {error.code} {error.reason}"
            except URLError as error:
                # The connection's own timeout may fire before the deadline, which is on another thread.
                problem = late if isinstance(error.reason, TimeoutError) else f"cannot be reached: {error.reason}"
            except ValueError:  # its text names the cause
                problem = "a header value has an invalid character"
            except TimeoutError:
                problem = late
            except (HTTPException, OSError) as error:
                problem = str(error) or type(error).__name__
            if deadline.expired:
                problem = late
        path = url.removeprefix(site)
        raise DeliveryError(f"{site}: {problem.replace(path, '...') if len(path) > 1 else problem}")

    def _address(self) -> tuple[str, str]:
        """Return the whole address, and the part of it that error messages may contain: scheme, host and port."""
        variable = self._config.url_from
        url = read_secret(variable, self._environment).strip() if variable else self._config.url
        try:
            return url, site_of(url)
        except ValueError:
            raise DeliveryError(f"the environment variable {variable} is not the address of a web server") from None


class _NoRedirect(HTTPRedirectHandler):
    """Handler for ``urllib`` that treats each redirection as an error."""

    def redirect_request(self, *_: object, **__: object) -> None: ...


class _Connection(HTTPConnection):
    """HTTP connection with a deadline."""

    deadline: Deadline

    def connect(self) -> None:
        """Connect, and let the deadline watch the socket, also during the TLS handshake."""
        super().connect()
        self.deadline.watch_socket(self.sock)


class _SecureConnection(HTTPSConnection, _Connection):
    """HTTPS connection with a deadline; HTTPSConnection.connect calls _Connection.connect by the MRO."""


def _make_connection(kind: type[_Connection], deadline: Deadline, host: str, **options: Any) -> _Connection:
    connection = kind(host, **options)
    connection.deadline = deadline
    return connection


class _Http(HTTPHandler):
    def __init__(self, deadline: Deadline) -> None:
        super().__init__()
        self._connected = partial(_make_connection, _Connection, deadline)

    def http_open(self, req: Request) -> HTTPResponse:
        return self.do_open(self._connected, req)


class _Https(HTTPSHandler):
    def __init__(self, deadline: Deadline) -> None:
        super().__init__()
        self._connected = partial(_make_connection, _SecureConnection, deadline)

    def https_open(self, req: Request) -> HTTPResponse:
        return self.do_open(self._connected, req)
