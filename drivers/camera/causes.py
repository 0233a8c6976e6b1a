"""Causes of a missing picture, with hints, from HTTP status codes, errors and the log of FFmpeg."""

import errno
import re
import socket
import ssl
from collections.abc import Sequence
from http import HTTPStatus
from http.client import BadStatusLine, HTTPException, RemoteDisconnected
from urllib.parse import urlsplit

from drivers.camera.source import Source, SourceKind, display_name, source_kind
from drivers.errors import NotConnected

Cause = tuple[str, str]
"""Reason why a camera source gives no picture, and a hint."""

ADDRESS_HINT = (
    "usual addresses: :81/stream and /capture (ESP32-CAM), /?action=stream (mjpg-streamer), :8080/video (IP Webcam), "
    "/stream.mjpg; its manual or its page in a browser has the right one"
)
_ONE_VIEWER_HINT = "most small cameras allow one viewer at a time: close other browser tabs and programs"
_DEFAULT_PORTS = {"http": 80, "https": 443, "rtsp": 554, "rtmp": 1935}

_SUPPORTED_AUTH = (
    r"""basic\b|digest (?!.*algorithm="?(?!(?:md5|sha)"?(?:[,\s]|$)))(?!.*qop="?auth-int"?(?:[,\s]|$)).*="""
)
"""Authentication methods that ``urllib`` supports."""

_FFMPEG_LOG_PATTERNS = (
    (r"(?:failed: |error )(401|403|404|503)\b", 0),
    (r"refused", errno.ECONNREFUSED),
    (r"timed out|timeout", errno.ETIMEDOUT),
    (r"no route|unreachable", errno.EHOSTUNREACH),
    (r"resolve", socket.EAI_NONAME),
)
"""Patterns of FFmpeg's log. Each has an error number, or 0 if the pattern matches an HTTP status code."""


def source_error(name: str, source: Source, cause: Cause) -> NotConnected:
    """Return the error for an unavailable camera source; ``name`` is the part, ``cause`` reason and hint."""
    return NotConnected(f"{name}: {display_name(source)}: {cause[0]}", hint=cause[1])


def add_cause(failure: NotConnected, log: bytes, source: Source) -> NotConnected:
    """Return ``failure`` with the cause that is found in FFmpeg's ``log``; unchanged if there is none.

    The log is searched only if ``source`` is an address, not for a device or a file.
    """
    if source_kind(source) is not SourceKind.URL:
        return failure
    text = log.decode("utf-8", "replace")
    for pattern, what in _FFMPEG_LOG_PATTERNS:
        found = re.search(pattern, text, re.IGNORECASE)
        if found is None:
            continue
        error = socket.gaierror() if what == socket.EAI_NONAME else OSError(what, "")
        reason, hint = cause_of_status(int(found[1]), source) if found.groups() else cause_of_error(error, source)
        return NotConnected(f"{failure}: {reason}", hint=hint)
    return failure


def cause_of_status(status: int, source: Source, has_credentials: bool | None = None) -> Cause:
    """Return the cause of a missing picture for an HTTP status code from the address ``source``.

    ``has_credentials`` is True if the request had a name and a password; None if that follows from the address.
    """
    text = f"{status} {HTTPStatus(status).phrase}" if status in HTTPStatus._value2member_map_ else str(status)
    scheme, rest = str(source).split("://", 1)
    if status == HTTPStatus.UNAUTHORIZED:
        if "@" in rest if has_credentials is None else has_credentials:
            return (
                f"refuses this user name or password ({text})",
                "its page in a browser shows whether they are right; in an address @ is %40, / is %2F, : is %3A",
            )
        place = display_name(source).split("://", 1)[1]
        return (
            f"requires a user name and a password ({text})",
            f"write them into its address: {scheme}://NAME:PASSWORD@{place}",
        )
    if status == HTTPStatus.FORBIDDEN:
        return f"denies access ({text})", f"its page in a browser shows the permissions; {_ONE_VIEWER_HINT}"
    if status in (HTTPStatus.NOT_FOUND, HTTPStatus.GONE):
        return f"has no page at this address ({text})", ADDRESS_HINT
    if status >= 500:
        return f"is busy or faulty ({text})", f"{_ONE_VIEWER_HINT}; else restart the camera"
    if 300 <= status < 400:
        return f"redirects endlessly ({text})", ADDRESS_HINT
    return f"replied {text}", ADDRESS_HINT


def cause_of_sign_in(methods: Sequence[str]) -> Cause | None:
    """Return the cause if a camera offers only authentication ``methods`` that are not supported; else None."""
    if not methods or any(re.match(_SUPPORTED_AUTH, way, re.IGNORECASE) for way in methods):
        return None
    names = ", ".join(repr(way[:60]) for way in methods)
    hint = "choose Basic, or Digest with MD5, on the settings page of the camera"
    return f"offers only unsupported authentication methods: {names}", hint


def cause_of_page(page: str) -> Cause:
    """Return the cause of a missing picture if the address returns the web page ``page``."""
    title = re.search(r"<title[^>]*>\s*([^<]{1,60})", page, re.IGNORECASE)
    named = f": {title[1].strip()!r}" if title else ""
    if re.search(r"type\s*=\s*[\"']?password|log.?in|sign.?in", page, re.IGNORECASE):
        hint = f"the stream has an address of its own, which takes NAME:PASSWORD@ before the host; {ADDRESS_HINT}"
        return f"is a login page without pictures{named}", hint
    return f"is a web page without pictures{named}", f"the stream has an address of its own; {ADDRESS_HINT}"


def cause_of_error(error: Exception, source: Source) -> Cause:
    """Return the cause of a missing picture for an error in the connection to the address ``source``."""
    try:
        parts = urlsplit(str(source))
        host, port = parts.hostname or "", parts.port or _DEFAULT_PORTS.get(parts.scheme.lower(), 0)
    except ValueError:
        hint = "a port is 0 to 65535; in a password : is %3A, / is %2F, @ is %40, [ is %5B"
        return "invalid host or port", hint
    if not host:
        return "has no host", f"{parts.scheme}://HOST/"
    if isinstance(error, ssl.SSLError):
        return _cause_of_tls_error(error, host, port)
    if isinstance(error, HTTPException) and not isinstance(error, RemoteDisconnected):
        return _cause_of_http_error(error, port)
    if isinstance(error, socket.gaierror | UnicodeError):
        return f"no such host: {host}", f"`ping {host}`; or write its number (a name in .local needs avahi-daemon)"
    if isinstance(error, TimeoutError) or getattr(error, "errno", None) == errno.ETIMEDOUT:
        return f"{host} does not reply on port {port}", f"`ping {host}`: is it on, and in the same network?"
    if isinstance(error, ConnectionRefusedError) or getattr(error, "errno", None) == errno.ECONNREFUSED:
        hint = (
            f"is it on, and is {port} its port? ESP32-CAM streams on 81, RTSP cameras on 554; rpicam-vid needs --listen"
        )
        return f"connection refused: nothing listens on port {port} of {host}", hint
    if isinstance(error, RemoteDisconnected | ConnectionError):
        return "closed the connection without a reply", f"{_ONE_VIEWER_HINT}; else restart the camera"
    if getattr(error, "errno", None) in (errno.EHOSTUNREACH, errno.ENETUNREACH):
        return f"no route to {host}", f"`ping {host}`: is it on, and in the same network?"
    return f"{getattr(error, 'strerror', None) or error}", f"`ping {host}`"


def _cause_of_tls_error(error: ssl.SSLError, host: str, port: int) -> Cause:
    if not isinstance(error, ssl.SSLCertVerificationError):
        return f"does not speak TLS on port {port} ({error.reason})", "write http:// instead of https://"
    if "expired" in error.verify_message or "not yet valid" in error.verify_message:
        return (
            f"its TLS certificate is out of date: {error.verify_message}",
            "`date`: is the clock of this computer right?",
        )
    fetch = f"`openssl s_client -connect {host}:{port} </dev/null | openssl x509 > camera.pem`"
    hint = f"if it is your camera: {fetch}, then SSL_CERT_FILE=camera.pem before `mission`; or http://"
    return f"its TLS certificate is not trusted: {error.verify_message}", hint


def _cause_of_http_error(error: HTTPException, port: int) -> Cause:
    if not isinstance(error, BadStatusLine):
        return f"its reply is not HTTP: {type(error).__name__}", ADDRESS_HINT
    line = str(error).strip().strip("'")
    hint = (
        "write https://"
        if line[:1] == "\x15" or "HTTPS" in line
        else "write rtsp://"
        if "RTSP" in line
        else ADDRESS_HINT
    )
    return f"does not speak HTTP on port {port}: its reply begins with {line[:30]!r}", hint
