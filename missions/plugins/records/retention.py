"""Retention of the records that runs make by default: rotation by age and total size, not by free disk space."""

import fcntl
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from config.file_io import open_regular, read_regular, regular_opener, save_file
from missions.library.folders import state_folder

MAX_AGE_DAYS = 30
"""Maximum age in days of a record made by default."""

MAX_TOTAL_BYTES = 2_000_000_000
"""Maximum size in bytes of all records made by default together."""

SECONDS_PER_DAY = 24 * 3600.0

ORDER_FILE = ".order"
"""File with the names of the records in creation order, each ended by a zero byte."""

MAX_ORDER_BYTES = 1 << 20


def records_folder() -> Path:
    """Return the folder of records made by default; it may not exist."""
    return state_folder() / "records"


STUDIO_RECORDS_VARIABLE = "MISSION_STUDIO_RECORDS"
"""Environment variable with the folder whose records the studio shows, instead of the default folder."""


def studio_records_folder() -> Path:
    """Return the folder whose records the studio shows."""
    return Path(os.environ.get(STUDIO_RECORDS_VARIABLE) or records_folder())


def list_records(folder: Path) -> list[Path]:
    """Return the records in a folder, newest first; empty if there is no folder. Raises OSError."""
    found = list[tuple[float, Path]]()
    try:
        for path in folder.iterdir():
            if path.suffix == ".mcap" and path.is_file():
                with suppress(FileNotFoundError):  # another process removed it
                    found.append((path.stat().st_mtime, path))
    except FileNotFoundError:
        return []
    return [path for _, path in sorted(found, reverse=True)]


def remove_old_records(folder: Path, now: float) -> list[str]:
    """Create the private folder, and remove records that are too old or exceed the total size.

    ``now`` is Unix time. Returns the removed records with reasons. The newest record and those being written are kept.
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
    """Return records in creation order, newest first, even if the computer's clock was wrong.

    A computer without a real-time clock may create the newest record in 1970. So a file keeps the order in which
    records were first seen. New records are sorted by modification time.
    """
    there = {path.name: path for path in reversed(records)}
    with suppress(OSError):
        known = os.fsdecode(read_regular(folder / ORDER_FILE, MAX_ORDER_BYTES)).split("\0")
        there = {name: there[name] for name in known if name in there} | there
    with suppress(OSError):  # the modification times are enough if the file cannot be written
        os.close(regular_opener(str(folder / ORDER_FILE), os.O_RDWR | os.O_CREAT))
        save_file(folder / ORDER_FILE, os.fsencode("".join(f"{name}\0" for name in there)), 0o600)
    return [*there.values()][::-1]


def _expired_records(records: Iterable[Path], now: float) -> set[Path]:
    """Return the records older than ``MAX_AGE_DAYS``, as far as the clock can be trusted.

    If the clock were years ahead, all records would seem too old. So if there is a gap of ``MAX_AGE_DAYS`` without a
    record, all records before the gap are kept. Records with times in the future are kept too.
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
    """Remove a record that no process writes; return whether it was removed. Raises OSError."""
    with open_regular(path) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        path.unlink()
    return True
