"""Camera that is read over HTTP: a stream of JPEGs, or single pictures that are polled.

FFmpeg reads films and streams in other formats.
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
from drivers.camera.causes import cause_of_error, cause_of_page, cause_of_sign_in, cause_of_status, source_error
from drivers.camera.jpegs import JPEG_START, MAX_PICTURE_BYTES, JpegFinder
from drivers.camera.opencv import VideoFeed
from drivers.clock import Clock, SystemClock
from drivers.errors import NotConnected
from drivers.pictures.capture import OFFLINE_TIMEOUT
from drivers.pictures.decode import SKIPPED_PICTURE, decode_picture

ANSWER_TIMEOUT = 5.0
"""Seconds to wait for the response of a camera, and for each further part of the response."""

SNAPSHOT_INTERVAL = 0.125
"""Seconds between two requests for single pictures: an ESP32-CAM is no faster."""

RETRY_INTERVAL = 0.5
"""Seconds from a failed request to the next one."""

MAX_BACKLOG_BYTES = 4_000_000
"""Number of bytes after which reading stops, even if more have arrived; older pictures in these bytes are skipped."""

_READ_SIZE = 65536
_MAX_PAGE_BYTES = 4096  # bytes of a web page that are looked at
_CONNECTION_ERRORS = (OSError, HTTPException, ValueError, UnicodeError)


class _SupportedAuthMixin:
    """Mixin for authentication handlers of ``urllib`` that ignores authentication methods they do not support.

    The camera may offer another method that is supported.
    """

    def http_error_401(self, *args: Any) -> Any:
        """Authenticate the request; return None for an unsupported method, so that another handler is tried."""
        try:
            return super().http_error_401(*args)  # type: ignore[misc]
        except URLError as error:
            if isinstance(error, HTTPError) or isinstance(error.reason, Exception):
                raise
        except ValueError:
            pass
        return None


class _BasicHandler(_SupportedAuthMixin, HTTPBasicAuthHandler):
    pass


class _DigestHandler(_SupportedAuthMixin, HTTPDigestAuthHandler):
    pass


class WebFeed:
    """A ``drivers.camera.reader_process.BlockingFeed`` of an http or https address."""

    def __init__(self, name: str, source: str, clock: Clock | None = None) -> None:
        self._name = name
        self._source = source
        self._clock = clock or SystemClock()
        self._response: HTTPResponse | None = None
        self._finder = JpegFinder()
        self._is_single_picture = self._is_polled = False  # each response is one picture, and is requested repeatedly
        self._poll_at = self._last_picture_at = 0.0
        self._video_feed: VideoFeed | None = None

    def start(self) -> float | None:
        self._poll_at = self._last_picture_at = self._clock.now()
        self._is_polled = False
        self._send_request()
        return None if self._video_feed is None else self._video_feed.start()

    def grab(self, is_needed: Callable[[], bool]) -> Image | None:
        if self._video_feed is not None:
            return self._video_feed.grab(is_needed)
        while (data := self._next_picture()) is not None:
            self._last_picture_at = self._clock.now()
            if not is_needed():
                return SKIPPED_PICTURE
            image = decode_picture(data)
            if image is not None:
                return image
        return None

    def stop(self) -> None:
        response, self._response = self._response, None
        if response is not None:
            response.close()
        film, self._video_feed = self._video_feed, None
        if film is not None:
            film.stop()

    def _next_picture(self) -> bytes | None:
        """Return the newest picture received; None at the end of the stream."""
        while True:
            try:
                found = self._read_pictures()
            except NotConnected:
                if not self._is_polled or self._clock.now() - self._last_picture_at > OFFLINE_TIMEOUT:
                    raise
                self._poll_at = self._clock.now() + RETRY_INTERVAL  # one failed request is not a disconnect
                found = []
            if found:
                return found[-1]
            if self._response is None and not self._is_polled:
                return None

    def _read_pictures(self) -> list[bytes]:
        """Return the next pictures, oldest first; an empty list if none is complete yet."""
        if self._response is None:
            Event().wait(max(0.0, self._poll_at - self._clock.now()))
            self._poll_at = self._clock.now() + SNAPSHOT_INTERVAL
            self._send_request()
        response = self._response
        if response is None:
            return []
        found, size = list[bytes](), 0
        try:
            if self._is_single_picture:
                found, data = [response.read(MAX_PICTURE_BYTES)], b""
            else:
                data = response.read1(_READ_SIZE)
                found += self._finder.feed(data)
            while data and found and (size := size + len(data)) < MAX_BACKLOG_BYTES and _has_more(response):
                data = response.read1(_READ_SIZE)
                found += self._finder.feed(data)
        except _CONNECTION_ERRORS:
            data = b""
        if not data:  # end of the response
            self.stop()
        return [each for each in found if each]

    def _send_request(self) -> None:
        """Send the request and classify the response. Raises NotConnected if it has no pictures."""
        try:
            url, opener, given = _build_request(self._source)
        except (ValueError, UnicodeError) as error:
            raise source_error(self._name, self._source, cause_of_error(error, self._source)) from error
        try:
            response = opener.open(Request(url, headers={"Accept": "*/*"}), timeout=ANSWER_TIMEOUT)  # noqa: S310 - http
        except HTTPError as error:
            error.close()
            target = error.headers.get("Location", "") if 300 <= error.code < 400 else ""
            if target and urlsplit(target).scheme not in {"", "http", "https"}:
                cause = f"redirects to {without_secrets(target)}", "write that address"
            else:
                ways = error.headers.get_all("WWW-Authenticate", []) if error.code == HTTPStatus.UNAUTHORIZED else []
                cause = cause_of_sign_in(ways) or cause_of_status(error.code, self._source, given)
            raise source_error(self._name, self._source, cause) from error
        except URLError as error:
            reason = error.reason if isinstance(error.reason, Exception) else error
            raise source_error(self._name, self._source, cause_of_error(reason, self._source)) from error
        except _CONNECTION_ERRORS as error:
            raise source_error(self._name, self._source, cause_of_error(error, self._source)) from error
        self._response = response
        self._classify_response(response)

    def _classify_response(self, response: HTTPResponse) -> None:
        """Detect the kind of a response by its headers or first bytes. Raises NotConnected for a web page."""
        kind = response.headers.get("Content-Type", "").partition(";")[0].strip().lower()
        self._finder, self._is_single_picture = JpegFinder(), False
        if kind in {"", "application/octet-stream", "text/plain"}:
            kind = _guess_content_type(_peek(response), response)
        if kind.startswith("image/"):
            self._is_single_picture, self._is_polled = kind not in {"image/jpeg", "image/jpg", "image/pjpeg"}, True
        elif kind in {"text/html", "application/xhtml+xml"}:
            page = _peek(response).decode("utf-8", "replace")
            self.stop()
            raise source_error(self._name, self._source, cause_of_page(page))
        elif not kind.startswith("multipart/"):
            self.stop()
            self._video_feed = VideoFeed(self._name, self._source)


def _has_more(response: HTTPResponse) -> bool:
    """Return whether more bytes of an HTTP response can be read without waiting."""
    return not response.isclosed() and bool(select.select([response], [], [], 0)[0])


def _peek(response: HTTPResponse) -> bytes:
    """Return the first bytes of a response without consuming them; empty if the connection breaks."""
    try:
        return response.peek(_MAX_PAGE_BYTES)
    except _CONNECTION_ERRORS:
        return b""


def _guess_content_type(begin: bytes, response: HTTPResponse) -> str:
    """Return the content type of a response without a usable header, by its first bytes."""
    if begin.lstrip()[:1] == b"<":
        return "text/html"
    if begin.startswith(JPEG_START) and response.length is not None:
        return "image/jpeg"
    return "multipart/mixed" if JPEG_START in begin or begin.lstrip().startswith(b"--") else "video"


def _build_request(source: str) -> tuple[str, OpenerDirector, bool]:
    """Return the URL without credentials, an opener that sends them, and whether there are any. Raises ValueError."""
    parts = urlsplit(source)
    host, port = parts.hostname or "", parts.port
    if not host:
        raise ValueError("it has no host")
    place = f"[{host}]" if ":" in host else host.encode("idna").decode()
    place = place if port is None else f"{place}:{port}"
    path, query = (quote(part, safe="/%:=&?~+!$,;'@()*[]") for part in (parts.path or "/", parts.query))
    url = f"{parts.scheme.lower()}://{place}{path}" + (f"?{query}" if query else "")
    passwords = HTTPPasswordMgrWithDefaultRealm()
    given = parts.username is not None
    if given:
        passwords.add_password(None, url, unquote(parts.username or ""), unquote(parts.password or ""))
    opener = build_opener(
        ProxyHandler({}),  # a camera is in the local network: no proxy
        HTTPSHandler(context=ssl.create_default_context()),
        _BasicHandler(passwords),
        _DigestHandler(passwords),
    )
    return url, opener, given
