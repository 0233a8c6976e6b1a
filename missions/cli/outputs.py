"""Files that commands write where the user says: told in words where that cannot be."""

import os
import shlex
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EEXIST, EISDIR, ENOENT, ENOSPC, ENOTDIR
from pathlib import Path

import click

from config.editing import put_on_disk, rewrite
from missions.library.folders import state_folder

MIN_ROOM = 65_536
"""Bytes that must fit where a procedure is going to write its result."""


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


def check_writable(path: Path, option: str) -> None:
    """Raise click.BadParameter unless ``path`` can be written: before a procedure whose result it is to hold.

    The file may be there already; links are followed. Nothing changes but for a file beside it, which is removed again.
    """
    target = Path(os.path.realpath(path))
    with writing(path, option):
        if target.is_dir():
            raise OSError(EISDIR, "it is a folder: name a file in it")
        if target.is_symlink() or (target.exists() and not target.is_file()):
            raise OSError(EEXIST, "it is not a regular file")
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError("it is write-protected")
        if not target.parent.is_dir():
            raise NotADirectoryError(ENOTDIR if target.parent.exists() else ENOENT, "no such folder")
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name[:100]}.") as probe:
            probe.write(b"\0" * MIN_ROOM)
            probe.flush()
            os.fsync(probe.fileno())


def save(path: Path, text: str) -> bool:
    """Write a result, whole or not at all; where that fails, rescue it. Return whether it stands at ``path``.

    The rescued text goes to a file in the state folder, else to stdout; stderr says where, and why.
    """
    try:
        _put(path, text)
    except OSError as error:
        click.echo(_why(path, error), err=True)
    else:
        return True
    for folder in (state_folder() / "rescued", Path(tempfile.gettempdir())):
        try:
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            number, name = tempfile.mkstemp(dir=folder, prefix=f"{path.stem[:50]}-", suffix=path.suffix)
            with os.fdopen(number, "w", encoding="utf-8") as file:
                file.write(text)
        except OSError:
            continue
        click.echo(f"the result was saved in {name} instead", err=True)
        return False
    click.echo("the result follows; copy it from here", err=True)
    click.echo(text)
    return False


def _put(path: Path, text: str) -> None:
    """Write ``text`` at ``path``, which may be there, and wait until it is on the disk. Raises OSError."""
    target = Path(os.path.realpath(path))
    if target.exists():
        if not target.is_file():
            raise OSError(EEXIST, "it is not a regular file")
        rewrite(target, text)
        return
    mask = os.umask(0)
    os.umask(mask)
    put_on_disk(target, text.encode(), 0o666 & ~mask)


def _why(path: Path, error: OSError) -> str:
    folder = path.parent
    if not folder.is_dir():
        return f"{path}: there is no folder {folder}\n  try: mkdir -p {shlex.quote(str(folder))}"
    room = f"\n  try: df -h {shlex.quote(str(folder))}  (is there room?)" if error.errno == ENOSPC else ""
    return f"{path}: cannot be written: {error.strerror or error}{room}"
