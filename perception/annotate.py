"""Drawing of detections into a picture, as frames with labels, for display."""

from collections.abc import Iterable
from math import isnan

import cv2
import numpy as np

from perception.api import Box, Image

INK = (80, 220, 60)  # blue, green, red: a green that shows on skin and on walls
MAX_PIXEL = 30_000
"""Largest pixel coordinate that OpenCV can draw."""

PAPER = (0, 0, 0)


def annotate(image: Image, marks: Iterable[tuple[Box, str]]) -> Image:
    """Return a copy of the picture with a frame around each box, and its label above unless empty.

    Boxes may reach beyond the picture; labels are moved inside. Line widths scale with the picture.
    """
    drawn = np.ascontiguousarray(image).copy()
    line = max(1, round(min(drawn.shape[:2]) / 240))
    for box, label in marks:
        edges = box.x, box.y, box.x + box.width, box.y + box.height
        if any(map(isnan, edges)):
            continue
        left, top, right, bottom = (round(min(max(edge, -MAX_PIXEL), MAX_PIXEL)) for edge in edges)
        corner = left, top
        cv2.rectangle(drawn, corner, (right, bottom), INK, line)
        if label:
            _draw_label(drawn, label, corner, line)
    return drawn


def _draw_label(image: Image, label: str, corner: tuple[int, int], line: int) -> None:
    """Write a label on a dark strip with its lower left end at ``corner``, moved inside the picture."""
    font, size = cv2.FONT_HERSHEY_SIMPLEX, 0.45 * line
    label = label.encode(errors="replace").decode()  # OpenCV dies of half a letter
    (width, height), below = cv2.getTextSize(label, font, size, line)
    tall = height + below + line
    x = max(0, min(corner[0], image.shape[1] - width))
    y = max(tall, min(corner[1], image.shape[0]))
    cv2.rectangle(image, (x, y - tall), (x + width, y), PAPER, cv2.FILLED)
    cv2.putText(image, label, (x, y - below), font, size, INK, line, cv2.LINE_AA)
