"""What a user means by the source of a camera: a number, a path or an address."""

import re
import sys
from enum import StrEnum
from pathlib import Path

from drivers.api.secrets import without_secrets

PICTURES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".webp", ".ppm", ".pgm", ".tif", ".tiff"})
"""The endings of files that hold one picture."""

VIDEOS = frozenset({".avi", ".mkv", ".mp4", ".m4v", ".mov", ".mjpg", ".mjpeg", ".mpg", ".mpeg", ".webm", ".ogv"})
"""The endings of files in a folder that hold a video."""

Source = int | str | Path


class Kind(StrEnum):
    """What sort of thing a source is."""

    DEVICE = "device"
    URL = "stream"
    FOLDER = "folder"
    PICTURE = "picture"
    VIDEO = "video"


def is_number(source: Source) -> bool:
    """Whether it is the number of a device, as a number or in figures."""
    return isinstance(source, int) or re.fullmatch("[0-9]{1,4}", str(source)) is not None


def kind_of(source: Source) -> Kind:
    """Tell the kind of ``source``: 0, "0" and "/dev/video0" are devices; a path that is absent is taken for a video."""
    if is_number(source) or str(source).startswith("/dev/"):
        return Kind.DEVICE
    if "://" in str(source):
        return Kind.URL
    path = Path(str(source))
    if path.is_dir():
        return Kind.FOLDER
    return Kind.PICTURE if path.suffix.lower() in PICTURES else Kind.VIDEO


def is_live(source: Source) -> bool:
    """Whether it goes on by itself and has no end: a device or a stream, but no recording."""
    kind = kind_of(source)
    return kind is Kind.DEVICE or (kind is Kind.URL and not str(source).lower().startswith("file:"))


def shown(source: Source) -> str:
    """Return what messages call a source: a path, a device, or an address without its password."""
    if is_number(source):  # OpenCV's numbers are those of /dev/video* on Linux, and nameless elsewhere
        return f"/dev/video{source}" if sys.platform == "linux" else f"camera {source}"
    return without_secrets(str(source))


def advice(source: Source) -> str:
    """Return what to type next when a source opens and yet gives no picture."""
    kind, what = kind_of(source), shown(source)
    if kind is Kind.DEVICE:
        return f"`fuser -v {what}` shows who else uses it; one camera often has several numbers: try the next"
    if what.startswith("http"):
        return f"open {what} in a browser"
    if kind is Kind.URL:
        return f"`ffplay {what}` shows whether the stream runs"
    if kind is Kind.FOLDER:
        return f"`file {Path(what) / '*'}` shows what is in there"
    return f"`file {what}` shows what is in there" if kind is Kind.PICTURE else f"`ffprobe {what}` shows what is in it"
