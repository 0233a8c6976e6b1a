"""Files that are written whole or not at all: a full disk, a power cut or Ctrl-C leaves the file that was there."""

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

PRIVATE = 0o600
"""The mode of a file that only its owner can read."""


@contextmanager
def whole_file(path: Path, mode: int | None = None, *, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a file that takes the place of ``path`` once all of it is on the disk; links are followed.

    ``mode`` None keeps that of the file that is there, or takes that of any new file. What is no regular file, such as
    a pipe, is written as it is. Not ``durable``, it may be empty after a power cut. Raises OSError.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        with target.open("wb") as there:
            yield there
        return
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, "it is write-protected", str(path))
    mode = mode if mode is not None else _mode_of(target)
    number, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name[:100]}.")  # for its owner only
    try:
        with os.fdopen(number, "wb") as file:
            yield file
            file.flush()
            if durable:
                os.fsync(file.fileno())
        with suppress(OSError):  # a disk that knows no rights, such as a stick's
            Path(name).chmod(mode)
        Path(name).replace(target)
    except BaseException as error:
        Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename is None:  # a full disk does not say whose it is
            error.filename = str(path)
        raise
    if durable:
        sync_folder(target.parent)


def save_file(path: Path, data: bytes | str, mode: int | None = None, *, durable: bool = True) -> None:
    """Write a file as ``whole_file`` does, text as UTF-8. Raises OSError."""
    with whole_file(path, mode, durable=durable) as file:
        file.write(data.encode(errors="backslashreplace") if isinstance(data, str) else data)


def sync_folder(folder: Path) -> None:
    """Wait until the names of files in a folder are on the disk. Raises OSError."""
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # a file system that cannot do this for folders
            raise
    finally:
        os.close(number)


def _mode_of(path: Path) -> int:
    """Return the mode of a file; that of a new one where there is none."""
    if path.exists():
        return path.stat().st_mode
    # os.umask can only be asked by setting it, which a file of another thread would feel.
    mask = "022"
    with suppress(OSError):
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        mask = next((line.split()[1] for line in status.splitlines() if line.startswith("Umask:")), mask)
    return 0o666 & ~int(mask, 8)
