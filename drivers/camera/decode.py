"""The calls into OpenCV that open and decode, without its chatter on the terminal, and within bounds."""

import io
import os
import stat
from pathlib import Path

import cv2
import numpy as np

from drivers.api import Image
from drivers.camera.size import Size, size_of
from drivers.errors import BadRequest

MOST_PIXELS = 50_000_000
"""Pixels of a picture or a frame: the largest cameras that one can buy for a robot have half of that.

Decoded and searched, so many take a third of a gigabyte.
"""

MOST_BYTES = 256_000_000
"""Bytes of a file with one picture: so many pixels without compression, and some more."""


def hush() -> None:
    """Silence OpenCV and FFmpeg for this process: what they would print, the callers say in one sentence.

    FFmpeg takes its level from the environment when OpenCV first opens a video; a level that the user set is kept.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


def load(path: Path) -> Image:
    """Return the picture in a file. Raises BadRequest for one that cannot be read or decoded, or is too large."""
    hush()
    try:
        with open(path, "rb", opener=_regular) as file:
            length = os.fstat(file.fileno()).st_size
            if length > MOST_BYTES:
                what = f"{path}: has {length / 1e6:.0f} MB, and a picture may have {MOST_BYTES / 1e6:.0f}"
                raise BadRequest(what, hint=f"`ls -l {path}` shows it")
            data = file.read(MOST_BYTES)
    except OSError as error:
        raise BadRequest(f"{path}: {error.strerror or error}", hint=f"`ls -l {path}` shows it") from error
    size = size_of(io.BytesIO(data))
    check_size(str(path), size)
    image = decoded(data)
    if image is None:
        raise BadRequest(f"{path}: cannot be decoded, {len(data)} bytes", hint=f"`file {path}` says what it is")
    return image


def decoded(data: bytes, most: int = MOST_PIXELS) -> Image | None:
    """Return a picture; None for what is none, and for one of more than ``most`` pixels, which is not decoded at all.

    What its header does not tell the size of is none.
    """
    size = size_of(io.BytesIO(data))
    if size is None or size[0] * size[1] > most:
        return None
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image, np.uint8)


def check_size(what: str, size: Size | None) -> None:
    """Raise BadRequest for a picture or frame, or whatever ``what`` names, with too many pixels."""
    if size is not None and size[0] * size[1] > MOST_PIXELS:
        width, height = size
        raise BadRequest(
            f"{what}: has {width} x {height} pixels, and {MOST_PIXELS / 1e6:.0f} million are the most",
            hint=f"`ffmpeg -i {what} -vf scale=4000:-2 smaller{Path(what).suffix}` makes it smaller",
        )


def opened(source: str | int, backend: int, settings: list[int], *, what: str) -> cv2.VideoCapture:
    """Open a video, stream or device. Raises BadRequest where its frames, or a picture that it is, are too large."""
    hush()
    if Path(what).is_file():  # a picture under a video's name is decoded when it is opened
        with Path(what).open("rb") as file:
            check_size(what, size_of(file))
    video = cv2.VideoCapture(source, backend, settings)
    try:
        check_size(what, (_number(video, cv2.CAP_PROP_FRAME_WIDTH), _number(video, cv2.CAP_PROP_FRAME_HEIGHT)))
    except BadRequest:
        video.release()
        raise
    return video


def grab(video: cv2.VideoCapture) -> Image | None:
    """Return the next picture of an open video; None at its end, or when the device has gone.

    A frame that is suddenly too large is its end.
    """
    try:
        found, image = video.read()
    except cv2.error:
        return None
    if not found or image.shape[0] * image.shape[1] > MOST_PIXELS:
        return None
    return np.asarray(image, np.uint8)


def skip(video: cv2.VideoCapture) -> bool:
    """Let the next picture of an open video go by; False at its end, or when the device has gone."""
    try:
        return video.grab()
    except cv2.error:
        return False


def _number(video: cv2.VideoCapture, key: int) -> int:
    return max(0, int(video.get(key)))


def _regular(path: str, flags: int) -> int:
    """Open a file, never waiting for one that is none. Raises OSError."""
    number = os.open(path, flags | os.O_NONBLOCK)
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(0, "is no file")
    return number
