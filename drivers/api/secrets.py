"""Names and passwords in addresses: they belong into robot files, and neither on a terminal nor into a record."""

import re
from collections.abc import Callable

_ADDRESS = re.compile(r"([A-Za-z][\w+.-]+:/+)([^\s'\"]+)")
"""An address; a path that was made of one has a slash less."""

_CREDENTIAL_WORDS = "pas|pw|auth|token|key|secret|sig|usr|user|login|session|sid"

_SECRET_PARAMETER = re.compile(rf"([^/?&;#=]*(?:{_CREDENTIAL_WORDS})[^/?&;#=]*=)([^&;#\s'\"]*)", re.IGNORECASE)
"""A parameter of an address that says who may look: cameras have them behind the question mark, and in the path."""

MASK = "***"


def without_secrets(text: str, *, aligned: bool = False) -> str:
    """Return a text, such as an address, without the names and passwords of the addresses in it.

    ``aligned`` keeps its length: carets below it stay where they belong.
    """

    def mask(secret: str) -> str:
        return "*" * len(secret) if aligned else MASK

    return _ADDRESS.sub(lambda found: found[1] + _mask_address(found[2], mask), text) if ":/" in text else text


def _mask_address(rest: str, mask: Callable[[str], str]) -> str:
    """Hide all up to the last @ of the host's part, or of all, where a password holds a slash."""
    host = re.split(r"[/?#]", rest, maxsplit=1)[0]
    torn = "@" not in host and re.search(r":(?![0-9]*$)", host.rpartition("]")[2]) is not None
    names, at, _ = (rest if torn else host).rpartition("@")
    if at:
        return mask(names) + at + _SECRET_PARAMETER.sub(lambda found: found[1] + mask(found[2]), rest[len(names) + 1 :])
    return _SECRET_PARAMETER.sub(lambda found: found[1] + mask(found[2]), rest)
