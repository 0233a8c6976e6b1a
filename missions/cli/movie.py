"""Pictures one after another, into a film or a folder: for whatever films something."""

import shlex
from pathlib import Path
from types import TracebackType
from typing import Self

import click
import cv2

from drivers.api import Image
from missions.cli.outputs import check_folder

CODECS = {".mp4": "mp4v", ".avi": "MJPG"}
"""By the ending of a film, codecs that come with OpenCV's wheels; any other name is a folder of pictures."""


def check_place(path: Path, option: str) -> None:
    """Raise click.UsageError for a place where no film can be made, or where one would take the place of something.

    ``option`` is what the user wrote before it.
    """
    if path.suffix in CODECS:
        if not path.parent.is_dir():
            raise click.UsageError(f"{option}: {path.parent}: no such folder")
    elif path.is_file():
        raise click.UsageError(f"{option}: {path} is a file; end it in {' or '.join(CODECS)}, or name a folder")
    elif path.is_dir() and any(path.iterdir()):
        raise click.UsageError(f"{option}: the folder {path} is not empty")
    else:
        check_folder(
            path, option, f"{option} {shlex.quote(str(path.with_suffix('.mp4')))}, or a name without an ending"
        )


class Movie:
    """Writes pictures of one size to ``path``: a film of ``rate`` pictures a second or, for any other name, a folder.

    Raises click.UsageError, naming the ``option``, where that cannot be written.
    """

    def __init__(self, path: Path, *, rate: float, option: str) -> None:
        self._path = path
        self._rate = rate
        self._option = option
        self._writer: cv2.VideoWriter | None = None
        self.pictures = 0

    def __enter__(self) -> Self:
        if not self.is_film:
            try:
                self._path.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise click.UsageError(f"{self._option}: {self._path}: {error.strerror}") from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is not None:
            self._writer.release()

    @property
    def is_film(self) -> bool:
        """Whether it is a film, in which every picture stays for as long as any other; else it is a folder."""
        return self._path.suffix in CODECS

    def write(self, picture: Image) -> None:
        """Add one picture."""
        if not self.is_film:
            written = cv2.imwrite(str(self._path / f"{self.pictures:05d}.jpg"), picture)
        else:
            if self._writer is None:
                codec = cv2.VideoWriter.fourcc(*CODECS[self._path.suffix])
                self._writer = cv2.VideoWriter(str(self._path), codec, self._rate, (picture.shape[1], picture.shape[0]))
            written = self._writer.isOpened()
            self._writer.write(picture)
        if not written:
            raise click.UsageError(f"{self._option}: cannot write {self._path}")
        self.pictures += 1
