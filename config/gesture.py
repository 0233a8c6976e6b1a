"""Gesture files: movements of the arm as keyframes, joint by joint, in quantities with units."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from config.faults import InvalidFileError
from config.fields import Fields, read_fields


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
    before = 0.0
    for node in fields.items("keyframes", required=True):
        frame = Fields(fields.source, node, fields.faults, what="a keyframe")
        time = frame.quantity("at", "duration", low=0.0)
        if time <= before and not fields.faults:
            frame.fault(node.mark, f"'at' must rise from keyframe to keyframe: {time:g} s after {before:g} s")
        before = time
        keyframes.append(
            (
                time,
                {
                    key.text: frame.measure(value, key.text, "angle")
                    for key, value in frame.entries()
                    if key.text != "at"
                },
            )
        )
    fields.done()
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return GestureConfig(name, summary, tuple(keyframes))
