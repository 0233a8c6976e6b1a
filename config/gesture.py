"""Gesture files: movements of the joints as keyframes, in quantities with units.

A few poses or hundreds of them, written by hand or by a recording, it is one form::

    gesture: nod
    summary: Nod once.
    interpolation: minimum_jerk      # rest at every keyframe, as when there is none; or `cubic`: go through them
    keyframes:
      - {at: 0.5 s, neck: 30 deg}
      - {at: 1 s, neck: 0 deg, waist: -5 deg}

A joint that a keyframe does not name stays where the one before had it. With ``cubic`` the first one may be at 0 s:
that is where the movement begins.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from config.faults import InvalidFileError, Source, one_of
from config.fields import Fields, fields_of
from config.marked import Listing, Node, Scalar, read_source
from config.units import written

Interpolation = Literal["minimum_jerk", "cubic"]

Reaches = Mapping[str, tuple[float, float]]
"""The lower and the upper limit (rad) of every joint that there is."""


@dataclass(frozen=True, slots=True)
class GestureConfig:
    """A gesture: (seconds since its start, joint angles in radians) in rising order of time."""

    name: str
    summary: str
    keyframes: tuple[tuple[float, Mapping[str, float]], ...]
    interpolation: Interpolation = "minimum_jerk"

    @property
    def joints(self) -> frozenset[str]:
        """The joints that it moves."""
        return frozenset(joint for _, positions in self.keyframes for joint in positions)


def load_gesture(path: Path, reaches: Reaches | None = None) -> GestureConfig:
    """Read a gesture file. Raises InvalidFileError with every mistake in it; with ``reaches``, of its angles too."""
    return gesture_of(read_source(path), reaches)


def gesture_of(source: Source, reaches: Reaches | None = None) -> GestureConfig:
    """Read the text of a gesture file. Raises as ``load_gesture`` does."""
    fields = fields_of(source, what="a gesture file")
    name, summary = fields.text("gesture"), fields.text("summary", "")
    cubic = fields.choice("interpolation", ["minimum_jerk", "cubic"], "minimum_jerk") == "cubic"
    keyframes: list[tuple[float, Mapping[str, float]]] = []
    for node in fields.items("keyframes", required=True):
        before = keyframes[-1][0] if keyframes else -1.0 if cubic else 0.0
        keyframe = Fields(fields.source, node, fields.faults, what="a keyframe")
        keyframes.append((_time(keyframe, before), _angles(keyframe, reaches)))
    listed = fields.node_of("keyframes")
    if isinstance(listed, Listing) and not keyframes:
        fields.fault(listed.mark, "'keyframes' needs at least one keyframe", "such as {at: 1 s, elbow: 90 deg}")
    fields.done()
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return GestureConfig(name, summary, tuple(keyframes), "cubic" if cubic else "minimum_jerk")


def beyond(joint: str, angle: float, limits: tuple[float, float]) -> str:
    """Say that ``angle`` is outside a joint's limits, a millionth of a radian allowed; empty where it is not."""
    if limits[0] - 1e-6 <= angle <= limits[1] + 1e-6:
        return ""
    lower, upper = (written(end, "angle") for end in limits)
    return f"'{joint}' at {written(angle, 'angle')} is outside its limits, {lower} to {upper}"


def _time(fields: Fields, before: float) -> float:
    """Read when a keyframe is, which must be later than ``before``."""
    mistakes = len(fields.faults)
    time = fields.quantity("at", "duration", low=0.0)
    place = fields.node_of("at")
    if place is not None and time <= before and len(fields.faults) == mistakes:
        fields.fault(place.mark, f"'at' must be later than {before:g} s, as keyframes follow one another")
    return time


def _angles(fields: Fields, reaches: Reaches | None) -> dict[str, float]:
    """Read the angles of a keyframe."""
    entries = [(key, node) for key, node in fields.entries() if key.text != "at"]
    return {key.text: _angle(fields, key, node, reaches) for key, node in entries}


def _angle(fields: Fields, joint: Scalar, node: Node, reaches: Reaches | None) -> float:
    mistakes = len(fields.faults)
    angle = fields.measure(node, joint.text, "angle")
    if reaches is None or len(fields.faults) > mistakes:
        return angle
    if joint.text not in reaches:
        fields.fault(joint.mark, f"there is no joint '{joint.text}'", one_of(joint.text, reaches))
    elif problem := beyond(joint.text, angle, reaches[joint.text]):
        fields.fault(node.mark, problem)
    return angle
