"""Camera stream for clients, as single JPEG pictures (no MJPEG).

Nothing is encoded while no client watches, so the detectors can rest.
"""

import base64
from collections.abc import Callable, Mapping
from itertools import chain
from threading import Lock
from typing import Any

from perception.api import Frame, Gaze, Percept, View

JPEG_QUALITY = 75
"""JPEG quality of the pictures for clients; a picture of 640 by 480 has about 40 kB."""

MAX_PICTURE_WIDTH = 800
"""Maximum width in pixels of the pictures for clients."""

PERCEPT_KINDS = {"Face": "face", "Thing": "thing", "Marker": "marker"}


class PictureFeed:
    """Newest camera frame of a run with its percepts, received from the vision thread; ``newest`` encodes it.

    ``wake`` is called from that thread when a frame arrives and a client watches pictures.
    """

    def __init__(self) -> None:
        self.is_watched = False
        self.wake: Callable[[], None] = lambda: None
        self._view: View | None = None
        self._frame: Frame | None = None
        self._encoded: Mapping[str, object] | None = None
        self._lock = Lock()

    def on_view(self, view: View) -> None:
        """Store the percepts of the frame that ``on_frame`` will receive next."""
        self._view = view

    def on_frame(self, frame: Frame, gaze: Gaze | None) -> None:
        """Store a frame if a client watches."""
        del gaze
        if self.is_watched:
            with self._lock:
                self._frame = frame
            self.wake()

    def newest(self) -> Mapping[str, object] | None:
        """Return the newest frame as members of a `picture`; None if there is none. Not thread-safe."""
        with self._lock:
            frame, self._frame = self._frame, None
        if frame is not None:
            self._encoded = _encode_picture(frame, self._view)
        return self._encoded


def _encode_picture(frame: Frame, view: View | None) -> Mapping[str, object]:
    import cv2  # noqa: PLC0415 - a run at which nobody looks needs none of it

    image: Any = frame.image
    shrunk = 1.0
    height, width = image.shape[:2]
    if width > MAX_PICTURE_WIDTH:
        shrunk = MAX_PICTURE_WIDTH / width
        image = cv2.resize(image, (MAX_PICTURE_WIDTH, round(height * shrunk)), interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    height, width = image.shape[:2]
    return {
        "t": frame.stamp,
        "width": width,
        "height": height,
        "jpeg": base64.b64encode(data.tobytes()).decode(),
        "found": [] if view is None or view.looked != frame.stamp else percepts_in(view, shrunk),
    }


def percepts_in(view: View, scale: float = 1.0) -> list[Mapping[str, object]]:
    """Return as JSON data the percepts that the newest frame of a view shows; boxes are multiplied by ``scale``.

    Percepts that were only seen in earlier frames are left out.
    """
    percepts = chain(view.faces, view.things, view.markers)
    return [_percept_dict(each, scale) for each in percepts if each.stamp == view.looked]


def _percept_dict(percept: Percept, scale: float) -> Mapping[str, object]:
    box = percept.box
    kind = PERCEPT_KINDS.get(type(percept).__name__, "thing")
    place = [round(value * scale, 1) for value in (box.x, box.y, box.width, box.height)]
    return {"kind": kind, "name": str(getattr(percept, "name", "")), "box": place}
