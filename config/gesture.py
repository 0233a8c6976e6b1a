"""Gesture files: keyframes of joint angles, and gait files.

A gesture has a few keyframes written by hand, or hundreds from a recording, in the same form::

    gesture: nod
    summary: Nod once.
    interpolation: minimum_jerk      # default: rest at every keyframe; or `cubic`, or `linear`
    keyframes:
      - {at: 0.5 s, neck: 30 deg}
      - {at: 1 s, neck: 0 deg, waist: -5 deg}

A joint that a keyframe does not name keeps its angle. With ``cubic`` the first keyframe may be at 0 s, which is where
the movement begins.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

from config.diagnostics import InvalidFileError, SourceText
from config.fields import fields_of
from config.section_reader import add_mistakes, read_keys
from config.units import quantity_text
from config.yaml_nodes import read_source
from drivers.api import Gesture, Interpolation, Keyframe
from drivers.api.fast_dataclass import dataclass
from drivers.api.gait import GaitKeys
from drivers.api.keys import KeyDiagnostic, key, keys

# Gait files: a gait of a humanoid, by parameters or by the positions of its soles over a cycle.
#
# By parameters, for the walking engine; the robot's own stride has the defaults:
#
#     gait: stroll
#     walk: {step: 60 mm, turn: 5 deg}
#
# By points, from the trunk's origin to the middles of the soles, in a smooth cycle:
#
#     gait: march
#     period: 1 s
#     points:
#       - {at: 0 %, left: [0 mm, 60 mm, -415 mm], right: [0 mm, -60 mm, -415 mm]}
#       - {at: 30 %, left: [0 mm, 60 mm, -390 mm], right: [0 mm, -60 mm, -415 mm], on: right}


def load_gait(path: Path) -> GaitKeys:
    """Read a gait file. Raises InvalidFileError with all errors."""
    fields = fields_of(read_source(path), subject="a gait file")
    found = read_keys(fields, GaitKeys)
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return found


LimitsByJoint = Mapping[str, tuple[float, float]]
"""Lower and upper limit (rad) of each joint, by the joint's name."""


@keys
class KeyframeKeys:
    """Keys of a keyframe of a gesture: joint angles at a time."""

    at: float = key("duration", low=0.0, help="Time from the beginning of the gesture.")
    joints: Mapping[str, float] = key("angle", rest=True, help="Angle of a joint, by its name.")


@keys
class GestureKeys:
    """Keys of a gesture file: name, summary, interpolation and keyframes."""

    gesture: str = key(help="Name.")
    summary: str = key(default="", help="Description in a line.")
    interpolation: Interpolation = key(
        default="minimum_jerk",
        help="`minimum_jerk` rests at every keyframe, `cubic` passes through smoothly, `linear` moves straight.",
    )
    keyframes: tuple[KeyframeKeys, ...] = key(each="a keyframe", help="Keyframes in the order of time.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for each keyframe that is not later than the one before."""
        if not self.keyframes:
            message, hint = "'keyframes' needs at least one keyframe", "such as {at: 1 s, elbow: 90 deg}"
            yield KeyDiagnostic(message, ("keyframes",), hint=hint)
        before = -1.0 if self.interpolation == "cubic" else 0.0
        for place, frame in enumerate(self.keyframes):
            if frame.at <= before:
                at = ("keyframes", place, "at")
                message = f"'at' must be later than {before:g} s, as keyframes follow one another"
                yield KeyDiagnostic(message, at, about=(at,))
            before = frame.at

    def limit_mistakes(self, limits: LimitsByJoint) -> Iterator[KeyDiagnostic]:
        """Yield an error for each angle outside its joint's limits, and for each unknown joint."""
        for place, frame in enumerate(self.keyframes):
            for joint, angle in frame.joints.items():
                at = ("keyframes", place, joint)
                if joint not in limits:
                    message = f"there is no joint '{joint}'"
                    yield KeyDiagnostic(
                        message, at, marks_key=True, unknown_word=joint, known_words=limits, about=(at,)
                    )
                elif problem := limit_error(joint, angle, limits[joint]):
                    yield KeyDiagnostic(problem, at, about=(at,))


@dataclass(frozen=True, slots=True)
class GestureConfig:
    """Gesture: keyframes of (seconds since the start, joint angles in radians) in rising order of time."""

    name: str
    summary: str
    keyframes: tuple[tuple[float, Mapping[str, float]], ...]
    interpolation: Interpolation = "minimum_jerk"

    @property
    def joints(self) -> frozenset[str]:
        """Joints that the gesture moves."""
        return frozenset(joint for _, positions in self.keyframes for joint in positions)

    @property
    def movement(self) -> Gesture:
        """The same gesture as a ``drivers.api.Gesture``, the type that behaviours use."""
        keyframes = tuple(Keyframe(time, positions) for time, positions in self.keyframes)
        return Gesture(self.name, self.summary, keyframes, self.interpolation)


def load_gesture(path: Path, limits: LimitsByJoint | None = None) -> GestureConfig:
    """Read a gesture file.

    Raises InvalidFileError with all errors; with ``limits``, angles beyond them are errors too.
    """
    return parse_gesture(read_source(path), limits)


def parse_gesture(source: SourceText, limits: LimitsByJoint | None = None) -> GestureConfig:
    """Return the gesture in a text. Raises as ``load_gesture``."""
    fields = fields_of(source, subject="a gesture file")
    found = read_keys(fields, GestureKeys)
    if limits is not None:
        add_mistakes(fields, found.limit_mistakes(limits))
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    keyframes = tuple((frame.at, frame.joints) for frame in found.keyframes)
    return GestureConfig(found.gesture, found.summary, keyframes, found.interpolation)


def limit_error(joint: str, angle: float, limits: tuple[float, float]) -> str:
    """Return the error if ``angle`` exceeds a joint's limits by more than a microradian, else an empty text."""
    if limits[0] - 1e-6 <= angle <= limits[1] + 1e-6:
        return ""
    lower, upper = (quantity_text(end, "angle") for end in limits)
    return f"'{joint}' at {quantity_text(angle, 'angle')} is outside its limits, {lower} to {upper}"
