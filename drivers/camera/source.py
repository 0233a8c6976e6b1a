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


class SourceKind(StrEnum):
    """What sort of thing a source is."""

    DEVICE = "device"
    URL = "stream"
    FOLDER = "folder"
    PICTURE = "picture"
    VIDEO = "video"


def is_number(source: Source) -> bool:
    """Whether it is the number of a device, as a number or in figures."""
    return isinstance(source, int) or re.fullmatch("[0-9]{1,4}", str(source)) is not None


def source_kind(source: Source) -> SourceKind:
    """Tell the kind of ``source``: 0, "0" and "/dev/video0" are devices; a path that is absent is taken for a video."""
    if is_number(source) or str(source).startswith("/dev/"):
        return SourceKind.DEVICE
    if "://" in str(source):
        return SourceKind.URL
    path = Path(str(source))
    if path.is_dir():
        return SourceKind.FOLDER
    return SourceKind.PICTURE if path.suffix.lower() in PICTURES else SourceKind.VIDEO


def is_live(source: Source) -> bool:
    """Whether it goes on by itself and has no end: a device or a stream, but no recording."""
    kind = source_kind(source)
    return kind is SourceKind.DEVICE or (kind is SourceKind.URL and not str(source).lower().startswith("file:"))


def display_name(source: Source) -> str:
    """Return what messages call a source: a path, a device, or an address without its password."""
    if is_number(source):  # OpenCV's numbers are those of /dev/video* on Linux, and nameless elsewhere
        return f"/dev/video{source}" if sys.platform == "linux" else f"camera {source}"
    return without_secrets(str(source))


def source_hint(source: Source) -> str:
    """Return what to type next when a source opens and yet gives no picture."""
    kind, what = source_kind(source), display_name(source)
    if kind is SourceKind.DEVICE:
        return f"`fuser -v {what}` shows who else uses it; one camera often has several numbers: try the next"
    if what.startswith("http"):
        return f"open {what} in a browser"
    if kind is SourceKind.URL:
        return f"`ffplay {what}` shows whether the stream runs"
    if kind is SourceKind.FOLDER:
        return f"`file {Path(what) / '*'}` shows what is in there"
    return (
        f"`file {what}` shows what is in there"
        if kind is SourceKind.PICTURE
        else f"`ffprobe {what}` shows what is in it"
    )
