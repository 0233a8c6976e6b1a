"""What stands at the place of a serial port, found out without opening it: that alone resets some boards."""

import os
import stat
from collections.abc import Mapping
from pathlib import Path

from drivers.errors import NotConnected

LISTED = "ls -l /dev/serial/by-id  (what is plugged in; or run with --simulate)"
"""What to type where a port is not what it should be."""

_KINDS = {
    stat.S_ISREG: "a file",
    stat.S_ISDIR: "a folder",
    stat.S_ISFIFO: "a pipe",
    stat.S_ISSOCK: "a socket",
    stat.S_ISBLK: "a disk",
}
"""What stands in a file system besides devices of characters, which serial ports are."""


def other_than_serial(port: str) -> str | None:
    """Say what stands at ``port`` where that is of no kind that a serial port can be.

    None for one that may be, and where there is nothing: it may be plugged in yet.
    """
    try:
        status = Path(port).stat()
    except (OSError, ValueError):
        return None
    for is_kind, word in _KINDS.items():
        if is_kind(status.st_mode):
            return word
    number = f"{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}"
    try:
        subsystem = (Path("/sys/dev/char") / number / "subsystem").resolve(strict=True).name
    except OSError:  # a pseudo-terminal is not listed
        return None
    return None if subsystem == "tty" else f"a device of another kind ({subsystem})"


def refuse_other_than_serial(ports: Mapping[str, str]) -> None:
    """Raise NotConnected where a part's port can never be one, with all that are not."""
    wrong = {part: what for part, port in ports.items() if (what := other_than_serial(port)) is not None}
    if wrong:
        found = (f"{part}: {ports[part]}: no serial port, but {what}" for part, what in wrong.items())
        raise NotConnected("\n".join(found), hint=LISTED)
