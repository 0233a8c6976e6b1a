"""Private output files: readable by their owner only, complete or absent, not overwriting by default.

The files are exported from records, which show people and contain their names.
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
    """The output file or folder exists already; the message has a hint how to overwrite it."""


def open_for_owner(path: str, flags: int) -> int:
    """Open a file so that only its owner can read it, also if it exists. Raises OSError.

    It has the signature of the argument ``opener`` of ``open``.
    """
    number = os.open(path, flags, 0o600)
    with suppress(OSError):  # a disk without permissions, such as a USB stick, or a file of another user
        os.fchmod(number, 0o600)
    return number


def open_private(path: Path) -> TextIO:
    """Open a text file for writing, readable by its owner only. Raises OSError."""
    return open(path, "w", encoding="utf-8", opener=open_for_owner)


class EarlierFile:
    """An existing output file at ``path``, kept under another name until the new file is complete.

    Links and special files, such as pipes, are not kept, but written directly. Methods raise OSError.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._backup: Path | None = None
        if not path.is_file() or path.is_symlink():
            return
        if not os.access(path, os.W_OK):
            raise PermissionError(errno.EACCES, "write-protected", str(path))
        number, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:100]}.")
        os.close(number)
        self._backup = path.replace(name)

    def remove(self) -> None:
        """Delete the earlier file after the new one is complete. Never raises."""
        if self._backup is not None:
            with suppress(OSError):
                self._backup.unlink()

    def restore(self) -> Path | None:
        """Give the earlier file its name back, and rename the incomplete new file.

        Return the incomplete file's new path; None if there is no earlier or no new file.
        """
        if self._backup is None:
            return None
        renamed = None
        if self._path.exists():
            renamed = self._path.replace(_unused_path(self._path.with_stem(f"{self._path.stem}-incomplete")))
        self._backup.replace(self._path)
        return renamed


def _unused_path(path: Path) -> Path:
    """Return ``path`` if no file exists there, else the path with the next free number after its stem."""
    names = (path if number == 1 else path.with_stem(f"{path.stem}-{number}") for number in count(1))
    return next(each for each in names if not each.exists())


@contextmanager
def new_file(path: Path, *, force: bool) -> Iterator[BinaryIO]:
    """Open a private file that replaces ``path`` once it is complete.

    Raises ExistsError, OSError.
    """
    if path.exists() and not force:
        raise ExistsError(f"{path}: already exists\n  try: another name, or --force to overwrite it")
    with replace_file(path, PRIVATE_MODE) as file:
        yield file


def new_folder(path: Path, *, force: bool) -> None:
    """Create a private folder, or require that an existing one is empty. Raises ExistsError, OSError."""
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not force and any(path.iterdir()):
        raise ExistsError(f"{path}: is not empty\n  try: another folder, or --force to overwrite its files")


def path_inside(name: str) -> Path:
    """Return the path of an attached file within a folder; a name cannot lead out of it."""
    parts = [part.replace("\0", "") for part in PurePosixPath(name).parts]
    return Path(*[part for part in parts if part not in ("", "/", "//", ".", "..")] or ["unnamed"])
