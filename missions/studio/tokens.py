"""Tokens that outlive the studio, where the user wishes that: a file that only the owner reads."""

import json
import os
import secrets
from contextlib import suppress
from pathlib import Path

from config.reading import parse_object, read_regular_text
from missions.library.folders import state_folder

NAMES = ("operator", "viewer")
SHORTEST = 24
"""Letters of a token, at least: 18 bytes of chance."""


def kept_in() -> Path:
    """Return the file in which they are kept."""
    return state_folder() / "studio.tokens"


def kept_tokens(path: Path | None = None) -> tuple[str, str]:
    """Return the operator's and the viewer's token of last time, or new ones that are kept now. Raises OSError."""
    path = kept_in() if path is None else path
    with suppress(FileNotFoundError, ValueError, TypeError, KeyError):
        found = parse_object(read_regular_text(path))
        operator, viewer = (str(found[name]) for name in NAMES)
        if min(len(operator), len(viewer)) >= SHORTEST and path.stat().st_mode & 0o077 == 0:
            return operator, viewer
    operator, viewer = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
    keep_tokens(operator, viewer, path)
    return operator, viewer


def keep_tokens(operator: str, viewer: str, path: Path | None = None) -> None:
    """Keep tokens for the next time, in the place of those that are kept. Raises OSError."""
    path = kept_in() if path is None else path
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with open(number, "w", encoding="ascii") as file:  # noqa: PTH123 - of a descriptor
        json.dump({"operator": operator, "viewer": viewer}, file)
