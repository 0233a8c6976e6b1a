"""Files that are made of records: never over another unless that is wanted, and whole or not at all.

Records show people and name them, so that nobody but their owner can read what is made of one, or one itself.
"""

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path, PurePosixPath
from typing import BinaryIO, TextIO

from config.file_io import PRIVATE_MODE, replace_file


class ExistsError(ValueError):
    """There is something where a file or folder is to be written; the message says how to do it all the same."""


def open_for_owner(path: str, flags: int) -> int:
    """Open a file for its owner only, also one that was there: an ``opener`` of ``open``. Raises OSError."""
    number = os.open(path, flags, 0o600)
    with suppress(OSError):  # a disk that knows no rights, such as a stick's, or a file of somebody else's
        os.fchmod(number, 0o600)
    return number


def open_private(path: Path) -> TextIO:
    """Open a file that only its owner can read, to write text. Raises OSError."""
    return open(path, "w", encoding="utf-8", opener=open_for_owner)


class EarlierFile:
    """The file that a run writes over as it goes, kept aside until the new one is whole.

    A link, and whatever is no regular file, such as a pipe, is written as it is. Its methods raise OSError.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._backup: Path | None = None
        if not path.is_file() or path.is_symlink():
            return
        if not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, "it is write-protected", str(path))
        number, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:100]}.")
        os.close(number)
        self._backup = path.replace(name)

    def remove(self) -> None:
        """Remove the earlier file: the new one is whole. Never raises."""
        if self._backup is not None:
            with suppress(OSError):
                self._backup.unlink()

    def restore(self) -> Path | None:
        """Put the earlier file back; return the new name of the incomplete one, None where nothing was renamed."""
        if self._backup is None:
            return None
        renamed = None
        if self._path.exists():
            renamed = self._path.replace(_unused_path(self._path.with_stem(f"{self._path.stem}-incomplete")))
        self._backup.replace(self._path)
        return renamed


def _unused_path(path: Path) -> Path:
    """Return ``path``, with a number after its stem where it exists already."""
    names = (path if number == 1 else path.with_stem(f"{path.stem}-{number}") for number in count(1))
    return next(each for each in names if not each.exists())


@contextmanager
def new_file(path: Path, *, force: bool) -> Iterator[BinaryIO]:
    """Open a file, for its owner only, that takes the place of ``path`` once all is written.

    Raises ExistsError, OSError.
    """
    if path.exists() and not force:
        raise ExistsError(f"{path}: is there already\n  try: another name, or --force to write over it")
    with replace_file(path, PRIVATE_MODE) as file:
        yield file


def new_folder(path: Path, *, force: bool) -> None:
    """Make a folder for its owner only, or see that it is empty: then it keeps its rights. Raises as ``new_file``."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not force and any(path.iterdir()):
        raise ExistsError(f"{path}: is not empty\n  try: another folder, or --force to write over what is in it")


def path_inside(name: str) -> Path:
    """Return the path of an attached file within a folder, out of which no name leads."""
    parts = [part.replace("\0", "") for part in PurePosixPath(name).parts]
    return Path(*[part for part in parts if part not in ("", "/", "//", ".", "..")] or ["unnamed"])
