"""Opening and decoding of pictures and videos by OpenCV, quietly and within size limits.

The size is read from the header first: a small compressed file may take gigabytes once decoded.
"""

import io
import os
import re
import stat
import struct
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np

from drivers.api import Image
from drivers.errors import BadRequest

SKIPPED_PICTURE: Image = np.empty((0, 0, 3), np.uint8)
"""Placeholder for a picture that was not decoded."""

NO_PICTURE: Image = np.empty((0, 0, 3), np.uint8)
"""Placeholder for a picture that has not arrived yet."""

Size = tuple[int, int]
"""Width and height of a picture in pixels."""

_MAX_PNM_HEADER = 65_536
"""Bytes of a PPM or PGM that are searched for its header."""

_JPEG_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Markers of a JPEG that are followed by its size."""

_JPEG_SEGMENTLESS_MARKERS = frozenset({0x01, *range(0xD0, 0xD9)})
"""Markers of a JPEG that are not followed by the length of a segment."""

_TIFF_SIZE_FIELDS = {256: 0, 257: 1, 322: 0, 323: 1}
"""Fields of a TIFF that contain a width (0) or a height (1), of the picture or of its tiles.

A decoder allocates memory for tiles as well.
"""


def picture_size(file: BinaryIO) -> Size | None:
    """Return the size of the PNG, JPEG, BMP, WebP, GIF, TIFF, PPM or PGM in a seekable file.

    None for other files, and if the header has no size.
    """
    file.seek(0)
    begin = file.read(32)
    try:
        return _header_size(file, begin)
    except struct.error:  # it ends in its header
        return None


def _header_size(file: BinaryIO, begin: bytes) -> Size | None:
    if begin.startswith(b"\x89PNG\r\n\x1a\n"):
        return struct.unpack(">II", begin[16:24]) if begin[12:16] == b"IHDR" else None
    if begin.startswith(b"\xff\xd8"):
        return _jpeg_size(file)
    if begin.startswith((b"GIF87a", b"GIF89a")):
        return struct.unpack("<HH", begin[6:10])
    if begin.startswith(b"BM"):
        (header,) = struct.unpack("<I", begin[14:18])
        width, height = struct.unpack(*("<HH", begin[18:22]) if header == 12 else ("<ii", begin[18:26]))
        return abs(width), abs(height)
    if begin.startswith(b"RIFF") and begin[8:12] == b"WEBP":
        return _webp_size(begin[12:])
    if begin.startswith((b"II*\0", b"MM\0*")):
        return _tiff_size(file, "<" if begin[:1] == b"I" else ">", begin)
    if re.match(rb"P[1-6]\s", begin):
        return _pnm_size(file)
    return None


def _jpeg_size(file: BinaryIO) -> Size | None:
    """Return the width and height of a JPEG, from its first frame marker; None if there is none.

    Bytes between segments are skipped, as decoders do.
    """
    file.seek(2)
    while byte := file.read(1):
        if byte != b"\xff":
            continue
        while byte == b"\xff":
            byte = file.read(1)
        if not byte:
            return None
        marker = byte[0]
        if marker == 0 or marker in _JPEG_SEGMENTLESS_MARKERS:
            continue
        (length,) = struct.unpack(">H", file.read(2))
        if marker in _JPEG_FRAME_MARKERS:
            height, width = struct.unpack(">xHH", file.read(5))
            return width, height
        file.seek(max(0, length - 2), 1)
    return None


def _webp_size(begin: bytes) -> Size | None:
    kind, data = begin[:4], begin[8:]
    if kind == b"VP8X":
        return int.from_bytes(data[4:7], "little") + 1, int.from_bytes(data[7:10], "little") + 1
    if kind == b"VP8L":
        (bits,) = struct.unpack("<I", data[1:5])
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 " and data[3:6] == b"\x9d\x01\x2a":
        width, height = struct.unpack("<HH", data[6:10])
        return width & 0x3FFF, height & 0x3FFF
    return None


def _tiff_size(file: BinaryIO, order: str, begin: bytes) -> Size | None:
    """Return the width and height of a TIFF; None without them.

    ``order`` is its byte order for ``struct``, ``begin`` its first bytes. If the tiles are larger than the picture,
    their size counts.
    """
    file.seek(*struct.unpack(f"{order}I", begin[4:8]))
    (count,) = struct.unpack(f"{order}H", file.read(2))
    found = [0, 0]
    for _ in range(count):
        tag, kind, _, value = struct.unpack(f"{order}HHI4s", file.read(12))
        if tag in _TIFF_SIZE_FIELDS:
            (number,) = struct.unpack(f"{order}H", value[:2]) if kind == 3 else struct.unpack(f"{order}I", value)
            found[_TIFF_SIZE_FIELDS[tag]] = max(found[_TIFF_SIZE_FIELDS[tag]], number)
    width, height = found
    return (width, height) if width and height else None


def _pnm_size(file: BinaryIO) -> Size | None:
    """Return the size in the header of a PPM or PGM; comments run from # to the end of their line."""
    file.seek(2)
    words = re.sub(rb"#[^\n]*(\n|$)", b"\n", file.read(_MAX_PNM_HEADER)).split(None, 2)
    if len(words) < 3 or not all(re.fullmatch(rb"[0-9]{1,9}", word) for word in words[:2]):
        return None
    return int(words[0]), int(words[1])


MAX_PIXELS = 50_000_000
"""Maximum pixels of a picture or frame: twice those of the largest cameras for robots.

To decode and search a picture of this size takes a third of a gigabyte.
"""

MAX_FILE_BYTES = 256_000_000
"""Maximum bytes of a file with one picture: enough for ``MAX_PIXELS`` without compression."""


FFMPEG_LOG_LEVEL = "OPENCV_FFMPEG_LOGLEVEL"
"""Environment variable by which OpenCV sets the log level of FFmpeg."""

FFMPEG_SILENT = "-8"
"""Log level of FFmpeg without output (AV_LOG_QUIET)."""


def silence_opencv() -> None:
    """Silence OpenCV and FFmpeg in this process; callers report failures in one sentence instead.

    FFmpeg reads its level from the environment when OpenCV first opens a video. A level set by the user is kept.
    """
    os.environ.setdefault(FFMPEG_LOG_LEVEL, FFMPEG_SILENT)
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


def load_picture(path: Path) -> Image:
    """Return the picture in a file. Raises BadRequest if it cannot be read or decoded, or is too large."""
    silence_opencv()
    try:
        with open(path, "rb", opener=_open_regular_file) as file:
            length = os.fstat(file.fileno()).st_size
            if length > MAX_FILE_BYTES:
                what = f"{path}: has {length / 1e6:.0f} MB, above the limit of {MAX_FILE_BYTES / 1e6:.0f}"
                raise BadRequest(what, hint=f"`ls -l {path}` shows it")
            data = file.read(MAX_FILE_BYTES)
    except OSError as error:
        raise BadRequest(f"{path}: {error.strerror or error}", hint=f"`ls -l {path}` shows it") from error
    size = picture_size(io.BytesIO(data))
    check_picture_size(str(path), size)
    image = decode_picture(data)
    if image is None:
        raise BadRequest(f"{path}: cannot be decoded, {len(data)} bytes", hint=f"`file {path}` shows its type")
    return image


def decode_picture(data: bytes, max_pixels: int = MAX_PIXELS) -> Image | None:
    """Return a decoded picture; None if it is invalid, of unknown size, or has more than ``max_pixels`` pixels."""
    size = picture_size(io.BytesIO(data))
    if size is None or size[0] * size[1] > max_pixels:
        return None
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image, np.uint8)


def check_picture_size(name: str, size: Size | None) -> None:
    """Raise BadRequest if the picture or frame called ``name`` has too many pixels."""
    if size is not None and size[0] * size[1] > MAX_PIXELS:
        width, height = size
        raise BadRequest(
            f"{name}: has {width} x {height} pixels, above the limit of {MAX_PIXELS / 1e6:.0f} million",
            hint=f"`ffmpeg -i {name} -vf scale=4000:-2 smaller{Path(name).suffix}` makes it smaller",
        )


def open_video(source: str | int, backend: int, settings: list[int], *, name: str) -> cv2.VideoCapture:
    """Return the opened video, stream or device. Raises BadRequest if its frames, or the picture in it, are too large.

    ``name`` is the path or name in the message, ``backend`` and ``settings`` are OpenCV's. FFmpeg prints errors to
    standard error, unless ``silence_opencv`` was called before.
    """
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    if Path(name).is_file():  # a picture under a video's name is decoded when it is opened
        with Path(name).open("rb") as file:
            check_picture_size(name, picture_size(file))
    video = cv2.VideoCapture(source, backend, settings)
    try:
        check_picture_size(
            name, (_video_property(video, cv2.CAP_PROP_FRAME_WIDTH), _video_property(video, cv2.CAP_PROP_FRAME_HEIGHT))
        )
    except BadRequest:
        video.release()
        raise
    return video


def grab_picture(video: cv2.VideoCapture, is_needed: Callable[[], bool] = lambda: True) -> Image | None:
    """Return the next picture of an open video; None at its end, on a disconnect, or for a frame that is too large.

    A frame for which ``is_needed`` returns False is not decoded.
    """
    try:
        if not video.grab():
            return None
        if not is_needed():
            return SKIPPED_PICTURE
        found, image = video.retrieve()
    except cv2.error:
        return None
    if not found or image.shape[0] * image.shape[1] > MAX_PIXELS:
        return None
    return np.asarray(image, np.uint8)


def _video_property(video: cv2.VideoCapture, key: int) -> int:
    return max(0, int(video.get(key)))


def _open_regular_file(path: str, flags: int) -> int:
    """Open a regular file without blocking. Raises OSError for other files."""
    number = os.open(path, flags | os.O_NONBLOCK)
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(0, "not a regular file")
    return number
