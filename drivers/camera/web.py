"""A camera that is read by HTTP: a stream of JPEGs, or one picture at a time, for which it is asked again and again.

Films and streams in other formats are for FFmpeg.
"""

import select
import ssl
from collections.abc import Callable
from http import HTTPStatus
from http.client import HTTPException, HTTPResponse
from threading import Event
from typing import Any
from urllib.error import HTTPError, URLError
from urllib.parse import quote, unquote, urlsplit
from urllib.request import (
    HTTPBasicAuthHandler,
    HTTPDigestAuthHandler,
    HTTPPasswordMgrWithDefaultRealm,
    HTTPSHandler,
    OpenerDirector,
    ProxyHandler,
    Request,
    build_opener,
)

from drivers.api import Image
from drivers.api.secrets import without_secrets
from drivers.camera.causes import missing, of_error, of_page, of_sign_in, of_status
from drivers.camera.jpegs import BEGIN, LARGEST_PICTURE, JpegFinder
from drivers.camera.opencv import VideoFeed
from drivers.clock import Clock, SystemClock
from drivers.errors import NotConnected
from drivers.pictures.capture import SILENCE
from drivers.pictures.decode import UNWANTED, decoded

ANSWER_TIMEOUT = 5.0
"""Seconds that a camera has to answer, and to send more of what it has begun."""

SNAPSHOT_INTERVAL = 0.125
"""Seconds from one question for a picture to the next: an ESP32-CAM can do no more."""

RETRY_INTERVAL = 0.5
"""Seconds from a question that was not answered to the next one."""

LATE = 4_000_000
"""Bytes that are read on while more lies ready, to get to the newest picture."""

_BLOCK = 65536
_PAGE = 4096  # bytes of a web page that are looked at
_FAULTS = (OSError, HTTPException, ValueError, UnicodeError)


class _KnownWays:
    """Passes over a way to sign in that ``urllib`` does not support: the camera may offer another one."""

    def http_error_401(self, *args: Any) -> Any:
        """Sign in; return None where it is not known how."""
        try:
            return super().http_error_401(*args)  # type: ignore[misc]
        except URLError as error:
            if isinstance(error, HTTPError) or isinstance(error.reason, Exception):
                raise
        except ValueError:
            pass
        return None


class _BasicHandler(_KnownWays, HTTPBasicAuthHandler):
    pass


class _DigestHandler(_KnownWays, HTTPDigestAuthHandler):
    pass


class WebFeed:
    """A ``drivers.camera.reader_process.BlockingFeed`` of an address of http or https."""

    def __init__(self, name: str, source: str, clock: Clock | None = None) -> None:
        self._name = name
        self._source = source
        self._clock = clock or SystemClock()
        self._response: HTTPResponse | None = None
        self._finder = JpegFinder()
        self._whole = self._repeats = False  # each answer is a picture; it is asked for again and again
        self._due = self._came = 0.0
        self._film: VideoFeed | None = None

    def start(self) -> float | None:
        """Ask for pictures. Raises NotConnected with the reason when there are none."""
        self._due = self._came = self._clock.now()
        self._repeats = False
        self._ask()
        return None if self._film is None else self._film.start()

    def grab(self, wanted: Callable[[], bool]) -> Image | None:
        """Return the next picture that can be decoded; None when there is no more: see BlockingFeed."""
        if self._film is not None:
            return self._film.grab(wanted)
        while (data := self._next()) is not None:
            self._came = self._clock.now()
            if not wanted():
                return UNWANTED
            image = decoded(data)
            if image is not None:
                return image
        return None

    def stop(self) -> None:
        """Close the connection."""
        response, self._response = self._response, None
        if response is not None:
            response.close()
        film, self._film = self._film, None
        if film is not None:
            film.stop()

    def _next(self) -> bytes | None:
        """Return the newest picture that has come; None when there is no more."""
        while True:
            try:
                found = self._read()
            except NotConnected:
                if not self._repeats or self._clock.now() - self._came > SILENCE:
                    raise
                self._due = self._clock.now() + RETRY_INTERVAL  # one question that goes wrong is no camera lost
                found = []
            if found:
                return found[-1]
            if self._response is None and not self._repeats:
                return None

    def _read(self) -> list[bytes]:
        """Return the pictures that come next, oldest first; none where there is no whole one yet."""
        if self._response is None:
            Event().wait(max(0.0, self._due - self._clock.now()))
            self._due = self._clock.now() + SNAPSHOT_INTERVAL
            self._ask()
        response = self._response
        if response is None:
            return []
        found, size = list[bytes](), 0
        try:
            if self._whole:
                found, data = [response.read(LARGEST_PICTURE)], b""
            else:
                data = response.read1(_BLOCK)
                found += self._finder.feed(data)
            while data and found and (size := size + len(data)) < LATE and _has_more(response):
                data = response.read1(_BLOCK)
                found += self._finder.feed(data)
        except _FAULTS:
            data = b""
        if not data:  # it is over
            self.stop()
        return [each for each in found if each]

    def _ask(self) -> None:
        """Send the request, and see what kind of answer comes. Raises NotConnected where it is no picture."""
        try:
            url, opener, given = _prepared(self._source)
        except (ValueError, UnicodeError) as error:
            raise missing(self._name, self._source, of_error(error, self._source)) from error
        try:
            response = opener.open(Request(url, headers={"Accept": "*/*"}), timeout=ANSWER_TIMEOUT)  # noqa: S310 - http
        except HTTPError as error:
            error.close()
            target = error.headers.get("Location", "") if 300 <= error.code < 400 else ""
            if target and urlsplit(target).scheme not in {"", "http", "https"}:
                cause = f"redirects to {without_secrets(target)}", "write that address"
            else:
                ways = error.headers.get_all("WWW-Authenticate", []) if error.code == HTTPStatus.UNAUTHORIZED else []
                cause = of_sign_in(ways) or of_status(error.code, self._source, given)
            raise missing(self._name, self._source, cause) from error
        except URLError as error:
            reason = error.reason if isinstance(error.reason, Exception) else error
            raise missing(self._name, self._source, of_error(reason, self._source)) from error
        except _FAULTS as error:
            raise missing(self._name, self._source, of_error(error, self._source)) from error
        self._response = response
        self._look_at(response)

    def _look_at(self, response: HTTPResponse) -> None:
        """See by its head, or by its beginning, what an answer is. Raises NotConnected for a web page."""
        kind = response.headers.get("Content-Type", "").partition(";")[0].strip().lower()
        self._finder, self._whole = JpegFinder(), False
        if kind in {"", "application/octet-stream", "text/plain"}:
            kind = _kind_of(_peeked(response), response)
        if kind.startswith("image/"):
            self._whole, self._repeats = kind not in {"image/jpeg", "image/jpg", "image/pjpeg"}, True
        elif kind in {"text/html", "application/xhtml+xml"}:
            page = _peeked(response).decode("utf-8", "replace")
            self.stop()
            raise missing(self._name, self._source, of_page(page))
        elif not kind.startswith("multipart/"):
            self.stop()
            self._film = VideoFeed(self._name, self._source)


def _has_more(response: HTTPResponse) -> bool:
    """Say whether more of an answer lies ready. Newer Pythons (3.13) close it, and its file, with its last byte."""
    return not response.isclosed() and bool(select.select([response], [], [], 0)[0])


def _peeked(response: HTTPResponse) -> bytes:
    """Return the first bytes of an answer, which stay there; none where it breaks off."""
    try:
        return response.peek(_PAGE)
    except _FAULTS:
        return b""


def _kind_of(begin: bytes, response: HTTPResponse) -> str:
    """Return what an answer is that does not say so, by its beginning."""
    if begin.lstrip()[:1] == b"<":
        return "text/html"
    if begin.startswith(BEGIN) and response.length is not None:
        return "image/jpeg"
    return "multipart/mixed" if BEGIN in begin or begin.lstrip().startswith(b"--") else "video"


def _prepared(source: str) -> tuple[str, OpenerDirector, bool]:
    """Return an address without name and password, what asks with them, and whether it has them. Raises ValueError."""
    parts = urlsplit(source)
    host, port = parts.hostname or "", parts.port
    if not host:
        raise ValueError("it names no host")
    place = f"[{host}]" if ":" in host else host.encode("idna").decode()
    place = place if port is None else f"{place}:{port}"
    path, query = (quote(part, safe="/%:=&?~+!$,;'@()*[]") for part in (parts.path or "/", parts.query))
    url = f"{parts.scheme.lower()}://{place}{path}" + (f"?{query}" if query else "")
    passwords = HTTPPasswordMgrWithDefaultRealm()
    given = parts.username is not None
    if given:
        passwords.add_password(None, url, unquote(parts.username or ""), unquote(parts.password or ""))
    opener = build_opener(
        ProxyHandler({}),  # a camera is near
        HTTPSHandler(context=ssl.create_default_context()),
        _BasicHandler(passwords),
        _DigestHandler(passwords),
    )
    return url, opener, given
