"""Mask user names and passwords in addresses, so that they reach neither a terminal nor a record."""

import re
from collections.abc import Callable

_ADDRESS = re.compile(r"([A-Za-z][\w+.-]+:/+)([^\s'\"]+)")
"""Pattern of an address such as ``rtsp://...``.

A single slash is accepted as well: an address that was treated as a path has lost its second one.
"""

_CREDENTIAL_WORDS = "pas|pw|auth|token|key|secret|sig|usr|user|login|session|sid"

_SECRET_PARAMETER = re.compile(rf"([^/?&;#=]*(?:{_CREDENTIAL_WORDS})[^/?&;#=]*=)([^&;#\s'\"]*)", re.IGNORECASE)
"""Pattern of a parameter in an address whose name tells that its value is secret, such as ``password=...``.

Addresses of network cameras have such parameters after ``?``, but also in the path.
"""

MASK = "***"


def without_secrets(text: str, *, aligned: bool = False) -> str:
    """Return ``text`` with the user names, passwords and secret parameters of its addresses masked.

    ``aligned`` keeps the length of the text, so that carets below it stay aligned.
    """

    def mask(secret: str) -> str:
        return "*" * len(secret) if aligned else MASK

    return _ADDRESS.sub(lambda found: found[1] + _mask_address(found[2], mask), text) if ":/" in text else text


def _mask_address(rest: str, mask: Callable[[str], str]) -> str:
    """Mask the user name, password and secret parameters of an address; ``rest`` is the address after ``//``.

    User name and password end at the last @ of the host, or of the whole address if a password contains a slash.
    ``mask`` returns the replacement of a text.
    """
    host = re.split(r"[/?#]", rest, maxsplit=1)[0]
    torn = "@" not in host and re.search(r":(?![0-9]*$)", host.rpartition("]")[2]) is not None
    names, at, _ = (rest if torn else host).rpartition("@")
    if at:
        return mask(names) + at + _SECRET_PARAMETER.sub(lambda found: found[1] + mask(found[2]), rest[len(names) + 1 :])
    return _SECRET_PARAMETER.sub(lambda found: found[1] + mask(found[2]), rest)
