"""Pictures of one person in a folder: for their owner only, and all that are added or none.

A picture is a file such as ``001.png``. Nothing else in the folder is touched, and no link is followed. Other programs
may add and remove meanwhile: what has gone between listing and reading is not there.
"""

import os
import re
import stat
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from hashlib import sha256
from pathlib import Path

from perception.api import Image

NEW = ".new-"
"""How the names of folders begin whose pictures are not all there yet."""

FEATURES = ".features.json"
"""What a network has made of the pictures in a folder: see ``missions.assembly.gallery``."""

MOST_PIXELS, MOST_BYTES = 4_000_000, 16_000_000
"""Pixels and bytes of a picture: a portrait is of some 300 x 300."""

_NAME = re.compile(r"([0-9]{3,})\.png")


def files_in(folder: Path) -> dict[Path, os.stat_result]:
    """Return the pictures in a folder, each with what the disk knows of it. Raises OSError."""
    found = {}
    with suppress(FileNotFoundError, NotADirectoryError):
        for path in sorted(folder.iterdir()):
            with suppress(FileNotFoundError):
                status = path.lstat()
                if _NAME.fullmatch(path.name) and stat.S_ISREG(status.st_mode):
                    found[path] = status
    return found


def read(path: Path) -> Image | None:
    """Return a picture; None for a file that is none, or too large for a portrait. Raises OSError."""
    if path.stat().st_size > MOST_BYTES:
        return None
    from drivers.pictures.decode import decoded  # noqa: PLC0415 - most commands read no picture

    return decoded(path.read_bytes(), MOST_PIXELS)


def digest(portrait: Image) -> bytes:
    """Return by what a picture is known again: the SHA-256 of its size and pixels."""
    return sha256(str(portrait.shape).encode() + portrait.tobytes()).digest()


def keep(portraits: Sequence[Image], folder: Path) -> None:
    """Add pictures to a folder, which need not be there, for their owner only. Raises OSError, and then adds none."""
    with ExitStack() as undone:
        new = Path(tempfile.mkdtemp(dir=folder.parent, prefix=NEW))  # for its owner only, as what is in it
        undone.callback(clear, new)
        for number, portrait in enumerate(portraits, start=_last_in(folder) + 1):
            _write(new / f"{number:03}.png", portrait)
        if folder.is_dir() and not folder.is_symlink():
            for path in files_in(new):
                undone.callback(path.rename(folder / path.name).unlink, missing_ok=True)
            new.rmdir()
        else:
            new.rename(folder)
        undone.pop_all()


def clear(folder: Path) -> int:
    """Delete the pictures in a folder and what was made of them; and it too when nothing is left in it.

    Return how many there were. Raises OSError.
    """
    pictures = files_in(folder)
    for path in (folder / FEATURES, *pictures):
        path.unlink(missing_ok=True)
    with suppress(OSError):  # there is something else in it, or it has gone
        folder.rmdir()
    return len(pictures)


def _last_in(folder: Path) -> int:
    """Return the highest number in a folder, also of what is a picture by name only: that must not be written over."""
    names = (path.name for path in folder.iterdir()) if folder.is_dir() else ()
    return max((int(found[1]) for name in names if (found := _NAME.fullmatch(name))), default=0)


def _write(path: Path, picture: Image) -> None:
    """Write a picture, and wait until it is on the disk."""
    import cv2  # noqa: PLC0415 - as above

    done, data = cv2.imencode(".png", picture)
    if not done:
        raise OSError(0, "a picture that cannot be encoded")
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data.tobytes())
        file.flush()
        os.fsync(file.fileno())
