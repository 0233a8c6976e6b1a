"""Files that are made of records: never over another unless that is wanted, and whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


class ExistsError(ValueError):
    """There is something where a file or folder is to be written; the message says how to do it all the same."""


@contextmanager
def new_file(path: Path, *, force: bool) -> Iterator[BinaryIO]:
    """Open a file that takes the place of ``path`` once all is written. Raises ExistsError, OSError."""
    if path.exists() and not force:
        raise ExistsError(f"{path}: is there already\n  try: another name, or --force to write over it")
    number, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(number, "wb") as file:
            yield file
        mask = os.umask(0)
        os.umask(mask)
        Path(name).chmod(0o666 & ~mask)  # as any other new file
        Path(name).replace(path)
    except BaseException:  # a Ctrl-C too must leave no half of a file
        Path(name).unlink(missing_ok=True)
        raise


def new_folder(path: Path, *, force: bool) -> None:
    """Make a folder, or see that it is empty. Raises ExistsError, OSError."""
    path.mkdir(parents=True, exist_ok=True)
    if not force and any(path.iterdir()):
        raise ExistsError(f"{path}: is not empty\n  try: another folder, or --force to write over what is in it")
