"""Time of the newest stop of all runs: ends a command that was still loading and that no search could find.

A stop writes the stamp before it searches. A command writes its note before it reads the stamp. So either the search
finds the note, or the command finds the stamp.
"""

import json
import os
import secrets
from contextlib import suppress
from functools import partial
from pathlib import Path

from config.reading import parse_object, read_regular_text
from missions.studio.places import Place, places
from missions.studio.processes import ProcessIdentity, here
from missions.studio.slow_folders import all_within

NAME = "newest.stop"

RESOLUTION = 2
"""Clock ticks by which the start of a process and the uptime may differ, since both are rounded."""


def write_stamp() -> None:
    """Write the time of a stop into all folders of this user, and for root into those of others.

    Raises OSError if no folder can take it.
    """
    text = json.dumps({"boot": here()[0], "ticks": _uptime()})
    done = all_within({place.folder: partial(_write, place, text) for place in places()})
    errors = [each for each in done.values() if each is not None]
    if len(errors) == len(done):
        raise errors[0] if errors else OSError("neither HOME nor XDG_RUNTIME_DIR says where a stamp can be")


def stamp_stop() -> str:
    """Note the time of a stop for commands that are still loading; return why that failed, empty where it did not."""
    try:
        write_stamp()
    except PermissionError:
        return ""  # nor can a command write its note there, and without one it moves no robot
    except OSError as error:
        why = f"what is loading does not learn of this stop ({error.strerror or error}): perhaps not stopped"
        return f"{why}\n  try: mission stop, once more"
    return ""


def is_stopped_since(process: ProcessIdentity) -> bool:
    """Return whether all was stopped after a process had started. Damaged stamps, and those of other boots, are old."""
    stamps = all_within({place.folder: partial(_read, place) for place in places()}).values()
    read = (stamp for stamp in stamps if not isinstance(stamp, OSError))
    return any(
        boot == process.boot and ticks + RESOLUTION >= process.start for boot, ticks in read if ticks is not None
    )


def _write(place: Place, text: str) -> None:
    folder = place.prepare() if place.is_own else place.folder
    begun = folder / f"{NAME}.{secrets.token_hex(8)}"  # two stops of one studio may be written at the same time
    number = os.open(begun, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o644)
    try:
        with os.fdopen(number, "w", encoding="utf-8") as file:
            file.write(text)
        begun.replace(folder / NAME)
    except BaseException:
        with suppress(OSError):
            begun.unlink()
        raise


def _read(place: Place) -> tuple[str, int | None]:
    """Return the boot and the clock tick of the stamp in a folder; None for the tick if there is none."""
    try:
        told = parse_object(read_regular_text(place.folder / NAME))
        return str(told["boot"]), int(told["ticks"])
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        # A command needs a folder that it can read for its own note.
        return "", None


def _uptime() -> int:
    """Return the clock ticks since the boot, as the start of a process is counted. Raises OSError."""
    seconds = float(Path("/proc/uptime").read_text(encoding="ascii").split()[0])
    return int(seconds * os.sysconf("SC_CLK_TCK"))
