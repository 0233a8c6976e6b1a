"""What a user means by the source of a camera: a number, a path or an address."""

import re
from enum import StrEnum
from pathlib import Path

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
