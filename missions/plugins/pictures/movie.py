"""Writes pictures one after another to a film or a folder.

Films show people: only their owner can read them. OpenCV's writer does not report a full disk, so this module checks
the free space and the written file.
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

from config.file_io import PRIVATE_MODE, save_file
from drivers.api import Image
from drivers.pictures.decode import silence_opencv
from missions.cli.outputs import check_folder

CODECS = {".webm": "VP80", ".mp4": "vp09", ".avi": "MJPG"}
"""OpenCV codec by film suffix; any other suffix means a folder of pictures.

Browsers play films with the first two suffixes; VP8 is faster to write.
"""

MIN_FREE_BYTES = 8_000_000
"""Bytes of the disk that stay free: OpenCV buffers up to five megabytes of a film until it is closed."""

PICTURES_PER_CHECK = 25
"""Number of pictures between two checks of the free disk space."""


def check_output(path: Path, option: str) -> None:
    """Raise click.UsageError if no film can be written to ``path``, or if it would replace an existing file.

    ``option`` is the option's name, for the message.
    """
    if path.suffix in CODECS:
        if not path.parent.is_dir():
            remedy = f"mkdir -p {shlex.quote(str(path.parent))}"
            raise click.UsageError(f"{option}: {path.parent}: no such folder\n  try: {remedy}")
    elif path.is_file():
        raise click.UsageError(f"{option}: {path} is a file; end it in {', '.join(CODECS)}, or name a folder")
    elif path.is_dir() and any(path.iterdir()):
        raise click.UsageError(f"{option}: the folder {path} is not empty")
    else:
        check_folder(
            path, option, f"{option} {shlex.quote(str(path.with_suffix('.webm')))}, or a folder name without a suffix"
        )


class Movie:
    """Writes pictures of one size to ``path``: a film of ``rate`` pictures a second or, for other suffixes, a folder.

    ``error`` has the time of the first failed picture, or of the failed film, and a remedy; empty without an error.
    Raises click.UsageError, which names ``option``, if it cannot be started.
    """

    def __init__(self, path: Path, *, rate: float, option: str) -> None:
        self._path = path
        self._rate = rate
        self._option = option
        self._writer: cv2.VideoWriter | None = None
        self._partial_path = path  # the film while it is written
        self._is_complete = False
        self.pictures = 0
        self.error = ""

    def __enter__(self) -> Self:
        if not self.is_film:
            try:
                self._path.mkdir(mode=0o700, parents=True, exist_ok=True)
            except OSError as error:
                raise self._usage_error(error) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is None:
            return
        self._writer.release()
        if not self.error and not self._is_readable():
            self._fail("the written file is damaged")
        if self.error and self._path.exists():
            self._partial_path.unlink(missing_ok=True)
            self.error = f"{self.error}\n  {self._path} is the earlier film; the new one was removed"
        elif self.pictures:
            self._partial_path.replace(self._path)
            self._is_complete = True
        else:
            self._partial_path.unlink(missing_ok=True)

    @property
    def is_written(self) -> bool:
        """Whether any pictures were written."""
        return self._is_complete if self.is_film else self.pictures > 0

    @property
    def is_film(self) -> bool:
        """Whether the output is a film, with a fixed picture rate, instead of a folder."""
        return self._path.suffix in CODECS

    def write(self, picture: Image) -> None:
        """Add one picture; ignored after an error."""
        if self.error:
            return
        if not self.is_film:
            self._write_picture(picture)
        else:
            self._writer = self._writer or self._open_writer(picture)
            if self.pictures % PICTURES_PER_CHECK == 0 and _free_bytes(self._path.parent) < MIN_FREE_BYTES:
                self._fail("the disk is full")
                return
            self._writer.write(picture)
        self.pictures += not self.error

    def _write_picture(self, picture: Image) -> None:
        done, packed = cv2.imencode(".jpg", picture)
        try:
            save_file(
                self._path / f"{self.pictures:05d}.jpg", packed.tobytes() if done else b"", PRIVATE_MODE, durable=False
            )
        except OSError as error:
            if not self.pictures:
                raise self._usage_error(error) from error
            self._fail(error.strerror or str(error))

    def _open_writer(self, first: Image) -> cv2.VideoWriter:
        """Return an OpenCV writer for a file that only its owner can read. Raises click.UsageError."""
        try:
            number, beside = tempfile.mkstemp(self._path.suffix, f".{self._path.stem[:100]}.", self._path.parent)
            os.close(number)  # OpenCV reopens it, and keeps its permissions
            self._partial_path = Path(beside)
        except OSError as error:
            raise self._usage_error(error) from error
        codec, size = cv2.VideoWriter.fourcc(*CODECS[self._path.suffix]), (first.shape[1], first.shape[0])
        with _mute_opencv():
            writer = cv2.VideoWriter(beside, codec, self._rate, size)
        if not writer.isOpened():
            self._partial_path.unlink(missing_ok=True)
            raise click.UsageError(f"{self._option}: cannot write {self._path}")
        return writer

    def _is_readable(self) -> bool:
        """Return whether the last picture of the closed film can be read, at its time."""
        with _mute_opencv():
            video = cv2.VideoCapture(str(self._partial_path))
            video.set(cv2.CAP_PROP_POS_FRAMES, self.pictures - 1)
            found, _ = video.read()
            last = video.get(cv2.CAP_PROP_POS_MSEC) / 1000
            counted = video.get(cv2.CAP_PROP_FRAME_COUNT)
            video.release()
        return found and last > (self.pictures - 2.5) / self._rate and counted > self.pictures - 2.5

    def _fail(self, why: str) -> None:
        seconds = f", {self.pictures / self._rate:.1f} s," if self.is_film else ""
        self.error = (
            f"{self._path}: ends after {self.pictures} pictures{seconds} or before: {why}\n"
            f"  try: df -h {shlex.quote(str(self._path.parent))}  (is there room?)"
        )

    def _usage_error(self, error: OSError) -> click.UsageError:
        return click.UsageError(f"{self._option}: {self._path}: {error.strerror or error}")


def _free_bytes(folder: Path) -> int:
    disk = os.statvfs(folder)
    return disk.f_bavail * disk.f_frsize


@contextmanager
def _mute_opencv() -> Iterator[None]:
    """Hide OpenCV's messages on stderr inside the context: it always warns that WebM has no number for VP8."""
    silence_opencv()
    before, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)
        os.close(nowhere)
