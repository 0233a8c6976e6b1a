"""Gesture files: movements of the arm as keyframes, joint by joint, in quantities with units."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from config.faults import InvalidFileError
from config.fields import Fields, read_fields
from config.marked import Listing


@dataclass(frozen=True, slots=True)
class GestureConfig:
    """A gesture: (seconds since its start, joint angles in radians) in rising order of time."""

    name: str
    summary: str
    keyframes: tuple[tuple[float, Mapping[str, float]], ...]

    @property
    def joints(self) -> frozenset[str]:
        """The joints that it moves."""
        return frozenset(joint for _, positions in self.keyframes for joint in positions)


def load_gesture(path: Path) -> GestureConfig:
    """Read a gesture file. Raises InvalidFileError with every mistake in it."""
    fields = read_fields(path, what="a gesture file")
    name, summary = fields.text("gesture"), fields.text("summary", "")
    keyframes: list[tuple[float, Mapping[str, float]]] = []
    for node in fields.items("keyframes", required=True):
        before = keyframes[-1][0] if keyframes else 0.0
        keyframes.append(_keyframe(Fields(fields.source, node, fields.faults, what="a keyframe"), before))
    listed = fields.node_of("keyframes")
    if isinstance(listed, Listing) and not keyframes:
        fields.fault(listed.mark, "'keyframes' needs at least one keyframe", "such as {at: 1 s, elbow: 90 deg}")
    fields.done()
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return GestureConfig(name, summary, tuple(keyframes))


def _keyframe(fields: Fields, before: float) -> tuple[float, Mapping[str, float]]:
    """Read one keyframe, which must come later than ``before``."""
    mistakes = len(fields.faults)
    time = fields.quantity("at", "duration", low=0.0)
    place = fields.node_of("at")
    if place is not None and time <= before and len(fields.faults) == mistakes:
        fields.fault(place.mark, f"'at' must be later than {before:g} s, as keyframes follow one another")
    joints = {key.text: fields.measure(value, key.text, "angle") for key, value in fields.entries() if key.text != "at"}
    return time, joints
