"""File access: regular files only, atomic replacement, and a record of all files that a run has read.

Files are read deep inside nested calls: a mission names a mission, which names a gesture, which names a sheet. So a
context variable of the thread or task collects them.
"""

import errno
import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from errno import EFBIG, EINVAL
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Any, BinaryIO

# Files that are written whole or not at all: a full disk, a power cut or Ctrl-C leaves the file that was there.

PRIVATE_MODE = 0o600
"""Mode of a file that only its owner can read."""


@contextmanager
def replace_file(path: Path, mode: int | None = None, *, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a file that replaces ``path`` when all of it is on the disk; symbolic links are followed.

    With ``mode`` None, the file keeps the mode of the old one and, if the user may do so, its owner; otherwise it gets
    the mode of a new file. Anything but a regular file, such as a pipe, is written directly. Without ``durable``, the
    file may be empty after a power cut. Raises OSError.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        with target.open("wb") as there:
            yield there
        return
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, "write-protected", str(path))
    old = target.stat() if mode is None and target.exists() else None
    mode = mode if mode is not None else _mode_of(target)
    number, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name[:100]}.")  # for its owner only
    try:
        with os.fdopen(number, "wb") as file:
            yield file
            file.flush()
            if durable:
                os.fsync(file.fileno())
        if old is not None:
            with suppress(OSError):  # only root may give a file to another user
                os.chown(name, old.st_uid, old.st_gid)
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
    """Write a file with ``replace_file``; text is encoded as UTF-8. Raises OSError."""
    with replace_file(path, mode, durable=durable) as file:
        file.write(data.encode(errors="backslashreplace") if isinstance(data, str) else data)


def sync_folder(folder: Path) -> None:
    """Wait until the directory entries of a folder are on the disk. Raises OSError."""
    number = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # a file system that cannot do this for folders
            raise
    finally:
        os.close(number)


def _mode_of(path: Path) -> int:
    """Return the mode of a file, or the mode that a new file gets."""
    if path.exists():
        return path.stat().st_mode
    # os.umask can only be asked by setting it, which a file of another thread would feel.
    mask = "022"
    with suppress(OSError):
        status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
        mask = next((line.split()[1] for line in status.splitlines() if line.startswith("Umask:")), mask)
    return 0o666 & ~int(mask, 8)


_READ_FILES: ContextVar[dict[Path, bytes] | None] = ContextVar("read", default=None)


@contextmanager
def collect_read_files() -> Iterator[Mapping[Path, bytes]]:
    """Collect all files that are read within the context, by resolved path, with their bytes."""
    files: dict[Path, bytes] = {}
    token = _READ_FILES.set(files)
    try:
        yield files
    finally:
        _READ_FILES.reset(token)


def record_read(path: Path, data: bytes | None = None) -> None:
    """Record a read file for ``collect_read_files``; without ``data`` the file is read here. Raises OSError."""
    files = _READ_FILES.get()
    if files is not None:
        files[path.resolve()] = path.read_bytes() if data is None else data


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading bytes. Raises OSError, also for a pipe, a socket or a device.

    Other files are not even opened: a pipe could block, and a serial port or watchdog timer reacts to it.
    """
    return open(path, "rb", opener=_regular)


def read_regular(path: Path, max_bytes: int) -> bytes:
    """Return the content of a regular file of at most ``max_bytes`` bytes. Raises OSError as ``open_regular``."""
    with open_regular(path) as file:
        data = file.read(max_bytes + 1) or b""  # None where the kernel's own files have nothing yet
    if len(data) > max_bytes:
        raise OSError(EFBIG, f"larger than {max_bytes:,} bytes", str(path))
    return data


def read_regular_text(path: Path, max_bytes: int = 1_000_000) -> str:
    """Return the text of a small regular file. Raises OSError as ``open_regular``, and UnicodeDecodeError."""
    return read_regular(path, max_bytes).decode("utf-8")


def parse_json(text: str | bytes, *, strict: bool = False) -> Any:
    """Return the value of a JSON text. Raises ValueError, also for too deep nesting.

    With ``strict``, duplicate members raise ValueError; Python alone keeps the last.
    """
    try:
        return json.loads(text, object_pairs_hook=_unique_members if strict else None)
    except RecursionError as error:
        raise ValueError("nested too deep") from error


def _unique_members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in found if names.count(name) > 1)
        raise ValueError(f"'{twice[:60]}' is a duplicate member")
    return found


def parse_object(text: str | bytes) -> dict[str, Any]:
    """Return the members of a JSON object. Raises ValueError, also for other values."""
    found = parse_json(text)
    if not isinstance(found, dict):
        raise ValueError(f"not an object but a {type(found).__name__}")
    return found


def regular_opener(path: str, flags: int) -> int:
    """Open a regular or new file; an ``opener`` for ``open``. Raises OSError for other files."""
    if not os.path.lexists(path):
        return os.open(path, flags | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    return _regular(path, flags)


def _regular(path: str, flags: int) -> int:
    _check_regular(path, Path(path).stat())
    number = os.open(path, flags & ~os.O_CREAT | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    try:
        _check_regular(path, os.fstat(number))  # another may have taken its place
    except OSError:
        os.close(number)
        raise
    return number


def _check_regular(path: str, status: os.stat_result) -> None:
    if not S_ISREG(status.st_mode) and not S_ISDIR(status.st_mode):  # of a folder, the system says so itself
        raise OSError(EINVAL, "not a regular file", path)
