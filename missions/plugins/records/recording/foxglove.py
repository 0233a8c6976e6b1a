"""Messages in Foxglove's schemas, so that Foxglove shows a record without configuration.

The schema names are documented at docs.foxglove.dev/docs/sdk/schemas; ours are in ``schemas.definitions``. Times are
{sec, nsec} since 1970; rotations are quaternions.
"""

import base64
from collections.abc import Mapping
from math import cos, isfinite, sin

from drivers.api import Pose2D, RangeScan
from perception.api import Box, Gaze, Marker, Percept, Thing, View

Json = dict[str, object]

LOG_LEVELS: Mapping[str, int] = {"debug": 1, "info": 2, "warning": 3, "error": 4, "critical": 5}
"""Foxglove's numbers of log levels; speech is logged as information."""

LINE_LOOP = 2
"""Foxglove's annotation type of a closed polygon."""

ODOMETRY_FRAME, BASE_FRAME, CAMERA_FRAME = "odom", "base", "camera"
"""Name of the camera's frame; ``ODOMETRY_FRAME`` is the pose of the base at the start, ``BASE_FRAME`` the base."""

_FONT_SIZE = 14.0
_TRANSPARENT: Json = {"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.0}
_LABEL_BACKGROUND: Json = {"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.6}
_FACE_COLOUR: Json = {"r": 0.2, "g": 0.9, "b": 0.3, "a": 1.0}
_THING_COLOUR: Json = {"r": 1.0, "g": 0.7, "b": 0.1, "a": 1.0}
_MARKER_COLOUR: Json = {"r": 0.3, "g": 0.7, "b": 1.0, "a": 1.0}


class Epoch:
    """Start time of a run; converts seconds of the run into Unix time."""

    def __init__(self, start_ns: int) -> None:
        self._start_ns = start_ns

    def nanoseconds(self, t: float) -> int:
        """Return ``t`` (s of the run) in ns since 1970."""
        return max(0, self._start_ns + round(t * 1e9))

    def stamp(self, t: float) -> Json:
        """Return ``t`` (s of the run) as Foxglove's time."""
        sec, nsec = divmod(self.nanoseconds(t), 1_000_000_000)
        return {"sec": sec, "nsec": nsec}


def log_message(stamp: Json, level: str, text: str, file: str) -> Json:
    """Return a Foxglove log message; its name is the speaker, or "mission" for a log level."""
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
    """Return a camera picture as a Foxglove image message."""
    data = base64.b64encode(jpeg).decode()
    return {"timestamp": stamp, "frame_id": CAMERA_FRAME, "data": data, "format": "jpeg"}


def annotations_message(stamp: Json, view: View) -> Json:
    """Return the percepts in a picture as Foxglove annotations: boxes with labels."""
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
    """Return the pose of the base as a Foxglove message."""
    return {"timestamp": stamp, "frame_id": ODOMETRY_FRAME, "pose": _pose((pose.x, pose.y, 0.0), pose.heading, 0.0)}


def base_transform(stamp: Json, pose: Pose2D) -> Json:
    """Return the transform from the odometry frame to the base as a Foxglove message."""
    return _transform(stamp, ODOMETRY_FRAME, BASE_FRAME, _pose((pose.x, pose.y, 0.0), pose.heading, 0.0))


def camera_transform(stamp: Json, eye: tuple[float, float, float], gaze: Gaze) -> Json:
    """Return the transform from the base to the camera, for the position ``eye`` (m) and the direction ``gaze``."""
    return _transform(stamp, BASE_FRAME, CAMERA_FRAME, _pose(eye, gaze.yaw, gaze.pitch))


def scan_message(stamp: Json, scan: RangeScan) -> Json:
    """Return a range finder scan as a Foxglove message; infinite and NaN ranges become 0, which is not drawn."""
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
    """Return whether all values are finite, as Foxglove requires."""
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
    """Return Foxglove's pose of a position, rotated by ``yaw`` about z, then by ``pitch`` about the new y (rad)."""
    (sy, cy), (sp, cp) = (sin(yaw / 2), cos(yaw / 2)), (sin(pitch / 2), cos(pitch / 2))
    x, y, z = place
    return {
        "position": {"x": x, "y": y, "z": z},
        "orientation": {"x": -sy * sp, "y": cy * sp, "z": sy * cp, "w": cy * cp},
    }
