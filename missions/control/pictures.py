"""What the camera sees, for who looks: nothing is encoded, and the eyes may rest, while nobody does."""

import base64
from collections.abc import Callable, Mapping
from itertools import chain
from threading import Lock
from typing import Any

from perception.api import Frame, Gaze, Percept, View

QUALITY = 75
"""Of the JPEG: a picture of 640 by 480 has some 40 kB."""

WIDEST = 800
"""Pixels of a picture's width, at most."""

WORDS = {"Face": "face", "Thing": "thing", "Marker": "marker"}


class Pictures:
    """Keeps the newest picture of a run, and what was found in it, from the thread of the eyes; ``newest`` packs it.

    ``wake`` is called from that thread when a picture has come while somebody is ``watched``.
    """

    def __init__(self) -> None:
        self.watched = False
        self.wake: Callable[[], None] = lambda: None
        self._view: View | None = None
        self._frame: Frame | None = None
        self._packed: Mapping[str, object] | None = None
        self._lock = Lock()

    def view(self, view: View) -> None:
        """Keep what was found in the picture that comes next."""
        self._view = view

    def frame(self, frame: Frame, gaze: Gaze | None) -> None:
        """Keep a picture, where somebody looks."""
        del gaze
        if self.watched:
            with self._lock:
                self._frame = frame
            self.wake()

    def newest(self) -> Mapping[str, object] | None:
        """Return the newest picture, packed, as a `picture` has it; None while there is none. For one thread."""
        with self._lock:
            frame, self._frame = self._frame, None
        if frame is not None:
            self._packed = _packed(frame, self._view)
        return self._packed


def _packed(frame: Frame, view: View | None) -> Mapping[str, object]:
    import cv2  # noqa: PLC0415 - a run at which nobody looks needs none of it

    image: Any = frame.image
    shrunk = 1.0
    height, width = image.shape[:2]
    if width > WIDEST:
        shrunk = WIDEST / width
        image = cv2.resize(image, (WIDEST, round(height * shrunk)), interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    height, width = image.shape[:2]
    return {
        "t": frame.stamp,
        "width": width,
        "height": height,
        "jpeg": base64.b64encode(data.tobytes()).decode(),
        "found": [] if view is None or view.looked != frame.stamp else found_in(view, shrunk),
    }


def found_in(view: View, shrunk: float = 1.0) -> list[Mapping[str, object]]:
    """Return what a view shows in its picture, as a `picture` has it; what is only remembered is not in it."""
    percepts = chain(view.faces, view.things, view.markers)
    return [_found(each, shrunk) for each in percepts if each.stamp == view.looked]


def _found(percept: Percept, shrunk: float) -> Mapping[str, object]:
    box = percept.box
    kind = WORDS.get(type(percept).__name__, "thing")
    place = [round(value * shrunk, 1) for value in (box.x, box.y, box.width, box.height)]
    return {"kind": kind, "name": str(getattr(percept, "name", "")), "box": place}
