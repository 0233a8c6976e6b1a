"""Tokens that outlive the studio, where the user wishes that: a file that only the owner reads."""

import json
import os
import secrets
from contextlib import suppress
from pathlib import Path

from missions.library.folders import state_folder

NAMES = ("operator", "viewer")
SHORTEST = 24
"""Letters of a token, at least: 18 bytes of chance."""


def kept_tokens(path: Path | None = None) -> tuple[str, str]:
    """Return the operator's and the viewer's token of last time, or new ones that are kept now. Raises OSError."""
    path = state_folder() / "studio.tokens" if path is None else path
    with suppress(OSError, ValueError, TypeError, KeyError):
        found = json.loads(path.read_text(encoding="ascii"))
        operator, viewer = (str(found[name]) for name in NAMES)
        if min(len(operator), len(viewer)) >= SHORTEST and path.stat().st_mode & 0o077 == 0:
            return operator, viewer
    operator, viewer = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    number = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with open(number, "w", encoding="ascii") as file:  # noqa: PTH123 - of a descriptor
        json.dump({"operator": operator, "viewer": viewer}, file)
    return operator, viewer
