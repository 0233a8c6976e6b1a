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


def check_folder(path: Path, option: str, instead: str) -> None:
    """Raise click.BadParameter where ``path`` has the ending of a file, and no folder of that name is there.

    ``instead`` says what to type for what was meant.
    """
    if path.suffix[1:2].isalpha() and not path.is_dir():
        raise click.BadParameter(
            f"{path} would become a folder, and ends in {path.suffix}\n  try: {instead}", param_hint=option
        )


def _why(path: Path, error: OSError) -> str:
    folder = path.parent
    if not folder.is_dir():
        return f"{path}: there is no folder {folder}\n  try: mkdir -p {shlex.quote(str(folder))}"
    room = f"\n  try: df -h {shlex.quote(str(folder))}  (is there room?)" if error.errno == ENOSPC else ""
    return f"{path}: cannot be written: {error.strerror or error}{room}"
