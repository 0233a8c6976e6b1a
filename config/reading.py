"""Which files were read, for who keeps a record of what a run was made of.

What is read lies deep inside of what asks for it: a mission names a mission that names a gesture that names a sheet. So
nobody hands a list down; who wants to know listens around the whole, in its own thread and task.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_READ: ContextVar[dict[Path, bytes] | None] = ContextVar("read", default=None)


@contextmanager
def files_read() -> Iterator[Mapping[Path, bytes]]:
    """Collect every file that is read within, by its whole path, with its bytes as they were then."""
    files: dict[Path, bytes] = {}
    token = _READ.set(files)
    try:
        yield files
    finally:
        _READ.reset(token)


def note_read(path: Path, data: bytes | None = None) -> None:
    """Note that a file was read, where somebody collects; without ``data``, its bytes are read here. Raises OSError."""
    files = _READ.get()
    if files is not None:
        files[path.resolve()] = path.read_bytes() if data is None else data
