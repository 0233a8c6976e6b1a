"""Messages as Foxglove knows them, so that it shows a record without being told anything.

It goes by the names of the schemas (docs.foxglove.dev/docs/sdk/schemas); those of the messages here stand in
``schemas.foxglove``. Times are {sec, nsec} since 1970; turns are quaternions.
"""

import base64
from collections.abc import Mapping
from math import cos, isfinite, sin

from drivers.api import Pose2D, RangeScan
from perception.api import Box, Gaze, Marker, Percept, Thing, View

Json = dict[str, object]

LOG_LEVELS: Mapping[str, int] = {"debug": 1, "info": 2, "warning": 3, "error": 4, "critical": 5}
"""How Foxglove numbers the levels of a log; voices are information."""

LINE_LOOP = 2
"""Points with lines from each to the next, and from the last to the first."""

ODOMETRY_FRAME, BASE_FRAME, CAMERA_FRAME = "odom", "base", "camera"
"""The frames: where the base was when the run began, the base, and the camera, which the head turns."""

_FONT_SIZE = 14.0
_TRANSPARENT: Json = {"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.0}
_LABEL_BACKGROUND: Json = {"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.6}
_FACE_COLOUR: Json = {"r": 0.2, "g": 0.9, "b": 0.3, "a": 1.0}
_THING_COLOUR: Json = {"r": 1.0, "g": 0.7, "b": 0.1, "a": 1.0}
_MARKER_COLOUR: Json = {"r": 0.3, "g": 0.7, "b": 1.0, "a": 1.0}


class Epoch:
    """When a run began: turns its seconds into times of day."""

    def __init__(self, start_ns: int) -> None:
        self._start_ns = start_ns  # ns since 1970

    def nanoseconds(self, t: float) -> int:
        """Return the nanoseconds since 1970 at ``t`` seconds of the run."""
        return max(0, self._start_ns + round(t * 1e9))

    def stamp(self, t: float) -> Json:
        """Return the same as Foxglove writes it."""
        sec, nsec = divmod(self.nanoseconds(t), 1_000_000_000)
        return {"sec": sec, "nsec": nsec}


def log_message(stamp: Json, level: str, text: str, file: str) -> Json:
    """Return a line of the log; ``name`` says who speaks, where that is not the program."""
    name = level if level not in LOG_LEVELS else "mission"
    return {
        "timestamp": stamp,
        "level": LOG_LEVELS.get(level, 2),
        "message": text,
        "name": name,
        "file": file,
        "line": 0,
    }


def image_message(stamp: Json, jpeg: bytes) -> Json:
    """Return a picture."""
    data = base64.b64encode(jpeg).decode()
    return {"timestamp": stamp, "frame_id": CAMERA_FRAME, "data": data, "format": "jpeg"}


def annotations_message(stamp: Json, view: View) -> Json:
    """Return what was found in a picture, as boxes with words."""
    coloured = [
        *((face, getattr(face, "name", "") or "face", _FACE_COLOUR) for face in view.faces),
        *((thing, _title(thing), _THING_COLOUR) for thing in view.things),
        *((marker, _title(marker), _MARKER_COLOUR) for marker in view.markers),
    ]
    fresh = [each for each in coloured if each[0].stamp == view.looked]
    return {
        "circles": [],
        "points": [_outline(stamp, percept.box, colour) for percept, _, colour in fresh],
        "texts": [_label(stamp, percept.box, text) for percept, text, _ in fresh],
    }


def _title(percept: Percept) -> str:
    match percept:
        case Thing(name=name):
            return name
        case Marker(name=name, number=number):
            return f"{name} ({number})" if name else str(number)
        case _:
            return ""


def _outline(stamp: Json, box: Box, colour: Json) -> Json:
    left, top, right, bottom = box.x, box.y, box.x + box.width, box.y + box.height
    return {
        "timestamp": stamp,
        "type": LINE_LOOP,
        "points": [{"x": x, "y": y} for x, y in ((left, top), (right, top), (right, bottom), (left, bottom))],
        "outline_color": colour,
        "outline_colors": [],
        "fill_color": _TRANSPARENT,
        "thickness": 2.0,
    }


def _label(stamp: Json, box: Box, text: str) -> Json:
    return {
        "timestamp": stamp,
        "position": {"x": box.x, "y": box.y},
        "text": text,
        "font_size": _FONT_SIZE,
        "text_color": {"r": 1.0, "g": 1.0, "b": 1.0, "a": 1.0},
        "background_color": _LABEL_BACKGROUND,
    }


def pose_message(stamp: Json, pose: Pose2D) -> Json:
    """Return where the base is."""
    return {"timestamp": stamp, "frame_id": ODOMETRY_FRAME, "pose": _pose((pose.x, pose.y, 0.0), pose.heading, 0.0)}


def base_transform(stamp: Json, pose: Pose2D) -> Json:
    """Return where the base is, as the place of its frame."""
    return _transform(stamp, ODOMETRY_FRAME, BASE_FRAME, _pose((pose.x, pose.y, 0.0), pose.heading, 0.0))


def camera_transform(stamp: Json, eye: tuple[float, float, float], gaze: Gaze) -> Json:
    """Return where the camera is on the base, and which way it looks from there."""
    return _transform(stamp, BASE_FRAME, CAMERA_FRAME, _pose(eye, gaze.yaw, gaze.pitch))


def scan_message(stamp: Json, scan: RangeScan) -> Json:
    """Return a turn of the range finder; Foxglove shows nothing at a distance of 0."""
    ranges = [each if isfinite(each) else 0.0 for each in scan.ranges.tolist()]
    return {
        "timestamp": stamp,
        "frame_id": BASE_FRAME,
        "pose": _pose((0.0, 0.0, 0.0), 0.0, 0.0),
        "start_angle": scan.start,
        "end_angle": scan.start + scan.step * max(len(ranges) - 1, 0),
        "ranges": ranges,
        "intensities": [],
    }


def is_finite(*values: float) -> bool:
    """Say whether Foxglove can take all these numbers."""
    return all(isfinite(value) for value in values)


def _transform(stamp: Json, parent: str, child: str, pose: Json) -> Json:
    return {
        "timestamp": stamp,
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": pose["position"],
        "rotation": pose["orientation"],
    }


def _pose(place: tuple[float, float, float], yaw: float, pitch: float) -> Json:
    """Return a place and a turn: by ``yaw`` about z, then by ``pitch`` about the new y."""
    (sy, cy), (sp, cp) = (sin(yaw / 2), cos(yaw / 2)), (sin(pitch / 2), cos(pitch / 2))
    x, y, z = place
    return {
        "position": {"x": x, "y": y, "z": z},
        "orientation": {"x": -sy * sp, "y": cy * sp, "z": sy * cp, "w": cy * cp},
    }
