"""The records that are kept by default: a folder of the user's, in which the oldest make room for the newest."""

import os
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from config.defaults import load_defaults
from missions.library.folders import state_folder

DAYS = 30
"""So old a record may grow."""

ROOM = 2_000_000_000
"""Bytes that all records may take together."""

SWITCH = "MISSION_RECORD"
"""A variable of the environment, before the user's default: ``no``, ``yes``, or ``all``, simulated runs too."""


def records_folder() -> Path:
    """Return the folder, which need not be there."""
    return state_folder() / "records"


SHOWN = "MISSION_STUDIO_RECORDS"
"""By which a studio tells the processes that read for it of another folder, whose records it shows."""


def shown_folder() -> Path:
    """Return the folder whose records the studio shows: that of those kept by default, if no other is named."""
    return Path(os.environ.get(SHOWN) or records_folder())


def records_in(folder: Path) -> list[Path]:
    """Return the records in a folder, the newest first; none where there is no folder. Raises OSError."""
    found = list[tuple[float, Path]]()
    try:
        for path in folder.iterdir():
            if path.suffix == ".mcap" and path.is_file():
                with suppress(FileNotFoundError):  # removed meanwhile
                    found.append((path.stat().st_mtime, path))
    except FileNotFoundError:
        return []
    return [path for _, path in sorted(found, reverse=True)]


def wanted(*, simulated: bool = False) -> bool:
    """Say whether a run is recorded by default: not where the user does not want it, or what writes records lacks.

    Raises InvalidFileError for the user's defaults.
    """
    said = os.environ.get(SWITCH, "").lower()
    wished = said not in ("no", "0", "off") if said else load_defaults().record
    return wished and (said == "all" or not simulated) and find_spec("mcap") is not None


def make_room(folder: Path, now: float) -> None:
    """Make the folder, for its owner alone, and take away what is too old, or too much; ``now`` is Unix time."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    size = 0
    for number, path in enumerate(records_in(folder)):
        with suppress(OSError):
            found = path.stat()
            size += found.st_size
            if number > 0 and (now - found.st_mtime > DAYS * 24 * 3600 or size > ROOM):  # the first may be written now
                path.unlink()
                size -= found.st_size
