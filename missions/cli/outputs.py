"""Files that commands write where the user says: told in words where that cannot be."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from errno import ENOSPC
from pathlib import Path

import click


@contextmanager
def writing(path: Path, option: str) -> Iterator[None]:
    """Say of an OSError while ``path`` is written what stands in the way, and what to type; ``option`` named it."""
    try:
        yield
    except OSError as error:
        raise click.BadParameter(_why(path, error), param_hint=option) from error


def _why(path: Path, error: OSError) -> str:
    folder = path.parent
    if not folder.is_dir():
        return f"{path}: there is no folder {folder}\n  try: mkdir -p {shlex.quote(str(folder))}"
    room = f"\n  try: df -h {shlex.quote(str(folder))}  (is there room?)" if error.errno == ENOSPC else ""
    return f"{path}: cannot be written: {error.strerror or error}{room}"
