"""Entry points of other distributions: found quickly, as each command looks at them, and loaded safely."""

import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from missions.library.trial import problem_of_entry_point, said

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


def offered(group: str) -> Sequence["EntryPoint"]:
    """Return the entry points of a ``group``, by name.

    Mostly there are none, which the files that declare them say in a few milliseconds; ``importlib.metadata`` takes a
    tenth of what a check does. What is on the path and no folder, such as an archive, only that can read.
    """
    folders = [Path(name) for name in dict.fromkeys(sys.path)]
    read = all(folder.is_dir() or not folder.exists() for folder in folders)
    if read and not _named(group, tuple((folder, _changed(folder)) for folder in folders)):
        return []
    from importlib.metadata import entry_points  # noqa: PLC0415 - where there are some

    return sorted(entry_points(group=group), key=lambda point: (point.name, point.value))


def _changed(folder: Path) -> int:
    """Return when a folder was changed last, in nanoseconds: something was installed, or went; 0 if it is not there."""
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=64)
def _named(group: str, folders: tuple[tuple[Path, int], ...]) -> bool:
    """Whether any distribution in ``folders``, as they were when they were changed last, declares a group."""
    files = (file for folder, _ in folders for file in folder.glob("*-info/entry_points.txt"))
    return any(group in file.read_text(encoding="utf-8", errors="replace") for file in files)


class BrokenOfferError(ValueError):
    """An entry point that cannot be loaded; the message says why."""


def load_offer(point: "EntryPoint") -> Any:
    """Import the object of an entry point, after a trial in a process of its own. Raises BrokenOfferError."""
    if problem := problem_of_entry_point(point):
        raise BrokenOfferError(problem.message)
    try:
        with redirect_stdout(sys.stderr):  # its output must not mix with the answer of the command
            return point.load()
    except Exception as error:
        raise BrokenOfferError(f"cannot be imported: {said(error)}") from error


def owner_of(point: "EntryPoint") -> str:
    """Return the name of the distribution that declares an entry point; empty where that is unknown."""
    return point.dist.name if point.dist is not None else ""


def described(point: "EntryPoint") -> str:
    """Return an entry point as it is declared, with its distribution."""
    owner = owner_of(point)
    return f"{point.name} = {point.value}" + (f" of {owner}" if owner else "")
