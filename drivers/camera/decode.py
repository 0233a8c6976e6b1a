"""The calls into OpenCV that open and decode, without its chatter on the terminal."""

import os
from pathlib import Path

import cv2
import numpy as np

from drivers.api import Image


def hush() -> None:
    """Silence OpenCV and FFmpeg for this process: what they would print, the callers say in one sentence.

    FFmpeg takes its level from the environment when OpenCV first opens a video; a level that the user set is kept.
    """
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)


def load(path: Path) -> Image | None:
    """Return the picture in a file, None when it cannot be read or decoded."""
    hush()
    try:
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if image is None else np.asarray(image, np.uint8)


def grab(video: cv2.VideoCapture) -> Image | None:
    """Return the next picture of an open video; None at its end, or when the device has gone."""
    try:
        found, image = video.read()
    except cv2.error:
        return None
    return np.asarray(image, np.uint8) if found and image is not None else None
