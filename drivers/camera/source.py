"""Camera sources as users write them: a number, a path or an address."""

import re
import sys
from enum import StrEnum
from pathlib import Path

from drivers.api.secrets import without_secrets

PICTURES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".webp", ".ppm", ".pgm", ".tif", ".tiff"})
"""File name extensions of pictures."""

VIDEOS = frozenset({".avi", ".mkv", ".mp4", ".m4v", ".mov", ".mjpg", ".mjpeg", ".mpg", ".mpeg", ".webm", ".ogv"})
"""File name extensions of videos in a folder."""

Source = int | str | Path


class SourceKind(StrEnum):
    """Kind of a camera source."""

    DEVICE = "device"
    URL = "stream"
    FOLDER = "folder"
    PICTURE = "picture"
    VIDEO = "video"


def is_number(source: Source) -> bool:
    """Return whether the source is a device number, as an integer or as text."""
    return isinstance(source, int) or re.fullmatch("[0-9]{1,4}", str(source)) is not None


def source_kind(source: Source) -> SourceKind:
    """Return the kind of ``source``: 0, "0" and "/dev/video0" are devices; a missing path counts as a video."""
    if is_number(source) or str(source).startswith("/dev/"):
        return SourceKind.DEVICE
    if "://" in str(source):
        return SourceKind.URL
    path = Path(str(source))
    if path.is_dir():
        return SourceKind.FOLDER
    return SourceKind.PICTURE if path.suffix.lower() in PICTURES else SourceKind.VIDEO


def is_live(source: Source) -> bool:
    """Return whether the source is a device or a stream, which have no end, and not a recording."""
    kind = source_kind(source)
    return kind is SourceKind.DEVICE or (kind is SourceKind.URL and not str(source).lower().startswith("file:"))


def display_name(source: Source) -> str:
    """Return the name of a source in messages: a path, a device, or an address without its password."""
    if is_number(source):  # OpenCV's numbers are those of /dev/video* on Linux, and nameless elsewhere
        return f"/dev/video{source}" if sys.platform == "linux" else f"camera {source}"
    return without_secrets(str(source))


def source_hint(source: Source) -> str:
    """Return the next command to type when a source opens but gives no picture."""
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
