"""Pictures one after another, into a film or a folder: for whatever films something.

Films show people: only their owner can read them. The library that writes films tells nobody of a full disk: what
became of one is found out here.
"""

import os
import shlex
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

import click
import cv2

from config.reading import PRIVATE, save_file
from drivers.api import Image
from drivers.pictures.decode import hush
from missions.cli.outputs import check_folder

CODECS = {".webm": "VP80", ".mp4": "vp09", ".avi": "MJPG"}
"""By the ending of a film, codecs of OpenCV's wheels; browsers play the first two, of which VP8 is written quicker.

Any other name is a folder of pictures.
"""

RESERVE = 8_000_000
"""Bytes of the disk that stay free: the library holds back up to five megabytes of a film until it is closed."""

LOOK = 25
"""Pictures of a film from one look at the room on the disk to the next."""


def check_place(path: Path, option: str) -> None:
    """Raise click.UsageError for a place where no film can be made, or where one would take the place of something.

    ``option`` is what the user wrote before it.
    """
    if path.suffix in CODECS:
        if not path.parent.is_dir():
            made = f"mkdir -p {shlex.quote(str(path.parent))}"
            raise click.UsageError(f"{option}: {path.parent}: no such folder\n  try: {made}")
    elif path.is_file():
        raise click.UsageError(f"{option}: {path} is a file; end it in {', '.join(CODECS)}, or name a folder")
    elif path.is_dir() and any(path.iterdir()):
        raise click.UsageError(f"{option}: the folder {path} is not empty")
    else:
        check_folder(
            path, option, f"{option} {shlex.quote(str(path.with_suffix('.webm')))}, or a name without an ending"
        )


class Movie:
    """Writes pictures of one size to ``path``: a film of ``rate`` pictures a second or, for any other name, a folder.

    ``trouble`` says from when on, or after all, it could not be written, and what to type; empty while all is well.
    Raises click.UsageError, naming the ``option``, where it cannot even be begun.
    """

    def __init__(self, path: Path, *, rate: float, option: str) -> None:
        self._path = path
        self._rate = rate
        self._option = option
        self._writer: cv2.VideoWriter | None = None
        self._beside = path  # the film until it is whole
        self._replaced = False
        self.pictures = 0
        self.trouble = ""

    def __enter__(self) -> Self:
        if not self.is_film:
            try:
                self._path.mkdir(mode=0o700, parents=True, exist_ok=True)
            except OSError as error:
                raise self._refused(error) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is None:
            return
        self._writer.release()
        if not self.trouble and not self._whole():
            self._stop("it cannot be read to its end")
        if self.trouble and self._path.exists():
            self._beside.unlink(missing_ok=True)
            self.trouble = f"{self.trouble}\n  {self._path} is the earlier film; the new one was removed"
        elif self.pictures:
            self._beside.replace(self._path)
            self._replaced = True
        else:
            self._beside.unlink(missing_ok=True)

    @property
    def written(self) -> bool:
        """Whether any of its pictures are at its path."""
        return self._replaced if self.is_film else self.pictures > 0

    @property
    def is_film(self) -> bool:
        """Whether it is a film, in which every picture stays for as long as any other; else it is a folder."""
        return self._path.suffix in CODECS

    def write(self, picture: Image) -> None:
        """Add one picture; none once there is trouble."""
        if self.trouble:
            return
        if not self.is_film:
            self._keep(picture)
        else:
            self._writer = self._writer or self._begun(picture)
            if self.pictures % LOOK == 0 and _room(self._path.parent) < RESERVE:
                self._stop("there is no more room on the disk")
                return
            self._writer.write(picture)
        self.pictures += not self.trouble

    def _keep(self, picture: Image) -> None:
        """Write a picture into the folder."""
        done, packed = cv2.imencode(".jpg", picture)
        try:
            save_file(
                self._path / f"{self.pictures:05d}.jpg", packed.tobytes() if done else b"", PRIVATE, durable=False
            )
        except OSError as error:
            if not self.pictures:
                raise self._refused(error) from error
            self._stop(error.strerror or str(error))

    def _begun(self, first: Image) -> cv2.VideoWriter:
        """Return what writes the film, into a file that only its owner can read. Raises click.UsageError."""
        try:
            number, beside = tempfile.mkstemp(self._path.suffix, f".{self._path.stem[:100]}.", self._path.parent)
            os.close(number)  # the library opens it anew, and leaves its rights alone
            self._beside = Path(beside)
        except OSError as error:
            raise self._refused(error) from error
        codec, size = cv2.VideoWriter.fourcc(*CODECS[self._path.suffix]), (first.shape[1], first.shape[0])
        with _unheard():
            writer = cv2.VideoWriter(beside, codec, self._rate, size)
        if not writer.isOpened():
            self._beside.unlink(missing_ok=True)
            raise click.UsageError(f"{self._option}: cannot write {self._path}")
        return writer

    def _whole(self) -> bool:
        """Say whether the last picture of the closed film can be read, at its time."""
        with _unheard():
            video = cv2.VideoCapture(str(self._beside))
            video.set(cv2.CAP_PROP_POS_FRAMES, self.pictures - 1)
            found, _ = video.read()
            last = video.get(cv2.CAP_PROP_POS_MSEC) / 1000
            counted = video.get(cv2.CAP_PROP_FRAME_COUNT)
            video.release()
        return found and last > (self.pictures - 2.5) / self._rate and counted > self.pictures - 2.5

    def _stop(self, why: str) -> None:
        seconds = f", {self.pictures / self._rate:.1f} s," if self.is_film else ""
        self.trouble = (
            f"{self._path}: ends after {self.pictures} pictures{seconds} or before: {why}\n"
            f"  try: df -h {shlex.quote(str(self._path.parent))}  (is there room?)"
        )

    def _refused(self, error: OSError) -> click.UsageError:
        return click.UsageError(f"{self._option}: {self._path}: {error.strerror or error}")


def _room(folder: Path) -> int:
    """Return how many bytes the disk of a folder has left."""
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize


@contextmanager
def _unheard() -> Iterator[None]:
    """Keep what OpenCV says on stderr from the terminal: past its own levels, that WebM has no number for VP8."""
    hush()
    before, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)
        os.close(nowhere)
