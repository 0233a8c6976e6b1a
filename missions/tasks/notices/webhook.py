"""Notices to a web server: one POST of JSON for each."""

from collections.abc import Mapping
from contextlib import closing
from http.client import HTTPException
from urllib.error import HTTPError, URLError
from urllib.request import HTTPRedirectHandler, Request, build_opener

from config.notices import WebhookNotice
from missions.tasks.notice import Notice
from missions.tasks.notices.refused import NotTaken, secret

TIMEOUT = 10.0
"""Seconds for which the server may be silent."""


class Webhook:
    """Posts each notice; the server has taken it when it answers 2xx.

    The header ``Idempotency-Key`` holds the notice's id, which is also in the JSON: so the server can drop doubles.
    A redirection is no delivery: a POST that follows one becomes a GET without its text.
    """

    def __init__(self, config: WebhookNotice, environment: Mapping[str, str], timeout: float = TIMEOUT) -> None:
        self._config, self._environment, self._timeout = config, environment, timeout

    def __call__(self, notice: Notice) -> None:
        """Post it once. Raises NotTaken for any other answer, and none."""
        url = self._config.url
        headers = {"Content-Type": "application/json", "Idempotency-Key": notice.id}
        headers |= {name: secret(value, self._environment) for name, value in self._config.headers.items()}
        request = Request(url, notice.as_json().encode(), headers, method="POST")  # noqa: S310 - http(s), as read
        try:
            with closing(build_opener(_Stay).open(request, timeout=self._timeout)):
                return
        except HTTPError as error:
            error.close()
            raise NotTaken(f"{url}: the server says {error.code} {error.reason}") from error
        except URLError as error:
            raise NotTaken(f"{url}: cannot be reached: {error.reason}") from error
        except (HTTPException, OSError, ValueError) as error:
            raise NotTaken(f"{url}: {str(error) or type(error).__name__}") from error


class _Stay(HTTPRedirectHandler):
    """Follows no redirection: each is an error then."""

    def redirect_request(self, *_: object, **__: object) -> None:
        """Return no request."""
