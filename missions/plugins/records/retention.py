"""The records that are kept by default: a folder of the user's, in which the oldest make room for the newest."""

import fcntl
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from config.file_io import open_regular, read_regular, regular_opener, save_file
from missions.library.folders import state_folder

MAX_AGE_DAYS = 30
"""So old a record may grow."""

MAX_TOTAL_BYTES = 2_000_000_000
"""Bytes that all records may take together."""

SECONDS_PER_DAY = 24 * 3600.0

ORDER_FILE = ".order"
"""The file with the names of the records in the order in which they were made, each ended by a zero byte."""

MAX_ORDER_BYTES = 1 << 20


def records_folder() -> Path:
    """Return the folder, which need not be there."""
    return state_folder() / "records"


STUDIO_RECORDS_VARIABLE = "MISSION_STUDIO_RECORDS"
"""By which a studio tells the processes that read for it of another folder, whose records it shows."""


def studio_records_folder() -> Path:
    """Return the folder whose records the studio shows: that of those kept by default, if no other is named."""
    return Path(os.environ.get(STUDIO_RECORDS_VARIABLE) or records_folder())


def list_records(folder: Path) -> list[Path]:
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


def remove_old_records(folder: Path, now: float) -> list[str]:
    """Make the folder, for its owner alone, and remove records that are too old, or too much.

    ``now`` is Unix time. Return what was removed, in words for people. The newest record may be written now, and stays,
    as does each that another process writes.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    records = _sort_by_age(folder, list_records(folder))
    old = _expired_records(records, now)
    removed, size = list[str](), 0
    for number, path in enumerate(records):
        with suppress(OSError):
            found = path.stat().st_size
            size += found
            why = (
                f"over {MAX_AGE_DAYS} days old"
                if path in old
                else f"records take over {MAX_TOTAL_BYTES / 1e9:g} GB" * (size > MAX_TOTAL_BYTES)
            )
            if number > 0 and why and _remove_unless_written(path):
                removed.append(f"{path.name} ({why})")
                size -= found
    return removed


def _sort_by_age(folder: Path, records: Sequence[Path]) -> list[Path]:
    """Return records in the order in which they were made, the newest first, whatever the clock was then.

    A computer without a battery for its clock may make the newest record in 1970. So the order is kept in a file, to
    which each record is added when it is first seen; those that are new to it are in the order of their stamps.
    """
    there = {path.name: path for path in reversed(records)}  # the oldest first
    with suppress(OSError):
        known = os.fsdecode(read_regular(folder / ORDER_FILE, MAX_ORDER_BYTES)).split("\0")
        there = {name: there[name] for name in known if name in there} | there
    with suppress(OSError):  # without room for it, or with something else in its place, the stamps will do
        os.close(regular_opener(str(folder / ORDER_FILE), os.O_RDWR | os.O_CREAT))
        save_file(folder / ORDER_FILE, os.fsencode("".join(f"{name}\0" for name in there)), 0o600)
    return [*there.values()][::-1]


def _expired_records(records: Iterable[Path], now: float) -> set[Path]:
    """Return the records that are too old, as far as their stamps and the clock can be trusted.

    A clock that is wrong by years would make all of them so. It is not believed across a gap in which no record was
    made for as long as a record may be kept; nor are stamps from the future. What is behind such a gap is not removed
    for its age.
    """
    stamps = dict[Path, float]()
    for path in records:
        with suppress(OSError):
            stamps[path] = path.stat().st_mtime
    found, last = set[Path](), now
    for path, stamp in sorted(stamps.items(), key=lambda each: -each[1]):
        if stamp > now:
            continue
        if last - stamp > MAX_AGE_DAYS * SECONDS_PER_DAY:
            break
        last = stamp
        if now - stamp > MAX_AGE_DAYS * SECONDS_PER_DAY:
            found.add(path)
    return found


def _remove_unless_written(path: Path) -> bool:
    """Remove a record that no process writes; return whether it is gone. Raises OSError."""
    with open_regular(path) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        path.unlink()
    return True
