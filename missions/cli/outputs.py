"""Output files of commands, with errors that name the problem and the command to type."""

import os
import shlex
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from errno import EACCES, EEXIST, EISDIR, ENOENT, ENOSPC, ENOTDIR, EROFS
from pathlib import Path

import click

from config.file_io import save_file
from config.yaml_edit import rewrite
from missions.library.folders import state_folder

MIN_FREE_BYTES = 65_536
"""Free bytes on the disk that are required before a long procedure starts whose result is written at its end."""


@contextmanager
def report_write_errors(path: Path, option: str) -> Iterator[None]:
    """Convert an OSError inside the context into click.BadParameter with a hint.

    ``path`` is the file being written; ``option`` is the command-line option that names it.
    """
    try:
        yield
    except OSError as error:
        raise click.BadParameter(_write_error_message(path, error), param_hint=option) from error


def written_message(*paths: Path | str, subject: str = "") -> str:
    """Return the line "wrote PATHS", which says who can read the files; ``subject`` is put before the paths.

    Reports, films and records show people, so they are created for their owner only. On a disk without permissions,
    such as a FAT stick, others can read them.
    """
    open_to_others = [path for path in map(Path, paths) if path.exists() and path.stat().st_mode & 0o077]
    names = ", ".join(map(str, paths))
    it = "it" if len(paths) == 1 else "them"
    who = f"others can read {', '.join(map(str, open_to_others))}" if open_to_others else f"only you can read {it}"
    return f"wrote {subject}{names} ({who})"


def check_folder(path: Path, option: str, command: str) -> None:
    """Raise click.BadParameter if ``path`` has the suffix of a file and is not an existing folder.

    ``option`` is the command-line option that names the path. ``command`` is printed as a hint: the command that the
    user probably meant.
    """
    if path.suffix[1:2].isalpha() and not path.is_dir():
        raise click.BadParameter(
            f"{path} would become a folder, but ends in {path.suffix}\n  try: {command}", param_hint=option
        )


def check_writable(path: Path, option: str) -> None:
    """Raise click.BadParameter unless ``path`` can be written; call it before a long procedure.

    An existing file and links are allowed. A temporary file is written beside the path and removed again.
    """
    target = Path(os.path.realpath(path))
    with report_write_errors(path, option):
        if target.is_dir():
            raise OSError(EISDIR, "it is a folder: name a file in it")
        if target.is_symlink() or (target.exists() and not target.is_file()):
            raise OSError(EEXIST, "it is not a regular file")
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError("write-protected")
        if not target.parent.is_dir():
            raise NotADirectoryError(ENOTDIR if target.parent.exists() else ENOENT, "no such folder")
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=f".{target.name[:100]}.") as probe:
            probe.write(b"\0" * MIN_FREE_BYTES)
            probe.flush()
            os.fsync(probe.fileno())


def save(path: Path, text: str) -> bool:
    """Write ``text`` to ``path`` atomically; return False if that fails and the text was saved elsewhere.

    In this case it is written to a file in the state folder or in /tmp, or else to stdout; stderr says where and why.
    """
    try:
        _write_file(path, text)
    except OSError as error:
        click.echo(_write_error_message(path, error), err=True)
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
    click.echo(f"{path} could not be written; the result follows on stdout", err=True)
    click.echo(text)
    return False


def _write_file(path: Path, text: str) -> None:
    """Write ``text`` to ``path``, which may exist, and sync it to disk. Raises OSError."""
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        raise OSError(EEXIST, "it is not a regular file")
    if target.exists():
        rewrite(target, text)
    else:
        save_file(target, text)


def _write_error_message(path: Path, error: OSError) -> str:
    """Return the message that ``path`` cannot be written, with a command for the user to type."""
    folder = shlex.quote(str(path.parent))
    in_the_way = next((each for each in path.parents if os.path.lexists(each)), path.parent)
    if error.errno in (EEXIST, ENOTDIR) and not os.path.isdir(in_the_way):  # noqa: PTH112 - Path raises without permission
        message = f"{path}: there is no folder {path.parent}: {in_the_way} is in the way"
        return f"{message}\n  try: ls -l {shlex.quote(str(in_the_way))}"
    if error.errno in (ENOENT, ENOTDIR) and not os.path.isdir(path.parent):  # noqa: PTH112 - Path raises at no permission
        return f"{path}: there is no folder {path.parent}\n  try: mkdir -p {folder}"
    folder = shlex.quote(str(in_the_way))  # it exists
    cures = {ENOSPC: f"df -h {folder}  (is there room?)", EROFS: f"findmnt -T {folder}  (is the disk read-only?)"}
    cure = cures.get(error.errno or 0, f"ls -ld {folder}  (may you write there?)" if error.errno == EACCES else "")
    return f"{path}: cannot be written: {error.strerror or error}" + (f"\n  try: {cure}" if cure else "")
