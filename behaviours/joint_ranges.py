"""Joints of an arm by name and group, with their limits, and the declaration of leaf arguments."""

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from typing import Any

from drivers.api import JointLimits
from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest

# The arguments of a leaf, declared once, in its class: for the checker, the catalogue, the schema and the docs.

REQUIRED: Any = object()
"""Marks an ``Argument`` without a default: a mission must give it."""


@dataclass(frozen=True, slots=True)
class Argument:
    """Argument of a leaf.

    ``kind`` is one of these:

    - a dimension: "angle", "length", "duration"...
    - a plain value: "text", "number", "count", "flag", "value" (anything), "choice" (a word of ``choices``)
    - "outcomes": a list of statuses
    - "condition": an expression; the leaf gets a ``Condition``, and evaluates it itself
    - "joint" (a name), or "joints" (a joint, a group, or a list of both)
    - a name in the library: "gesture", "move", "gait", "controller", "object"
    - "new move" (name of a recording to make), "file" (a path, relative to the mission's folder)
    - "face" (a variable with a face, or nothing)
    - "phrases" (a text or list of texts, known before the mission starts)
    - "head" or "arm": a part of which a robot may have several; the leaf sees that one as its robot's only one

    ``span`` takes two values, [low, high]; ``by_joint`` takes a value per joint, {elbow: 30 deg}. ``low`` and ``high``
    are bounds in SI units. A ``principal`` argument may be written without its name. ``attribute`` is the leaf's
    attribute that holds the value.
    """

    name: str
    kind: str
    help: str
    default: Any = REQUIRED
    principal: bool = False
    span: bool = False
    low: float = -math.inf
    high: float = math.inf
    by_joint: bool = False
    choices: tuple[str, ...] = ()
    attribute: str = ""

    @property
    def required(self) -> bool:
        """True if a mission must give the argument."""
        return self.default is REQUIRED


def argument(kind: str, help: str, *, name: str = "", **options: Any) -> Any:  # noqa: A002 - as argparse and click
    """Declare an argument of a leaf, as a class attribute.

    ``speed: float = argument("speed", "maximum speed", default=0.2)``.

    When the leaf starts, the attribute holds the value: SI floats for quantities, a pair for a span, a mapping for
    values by joint, a tuple of names for joints. For phrases it is a mapping from the normalised to the written form.
    ``name`` is the name in missions if the attribute cannot have it; every node has the attribute ``name``, for
    example.
    """
    return Argument(name=name, kind=kind, help=help, **options)


MIN_SIMILARITY = 0.75
"""Minimum similarity (0..1) of two joint names for "did you mean". It is high because a wrong joint would move."""

LIMIT_TOLERANCE = 1e-6
"""Radians by which an angle may exceed a limit, since values in degrees are rounded."""


@dataclass(frozen=True, slots=True)
class JointRanges:
    """Limits of each joint by name, in the order of the robot file, and the joint ``groups`` by name.

    ``arms`` are the ranges of all arms of a robot with several, by name; ``name`` is the name of this arm in messages.
    """

    joints: Mapping[str, JointLimits]
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    arms: Mapping[str, "JointRanges"] = field(default_factory=dict)
    name: str = "arm"

    def of_arm(self, arm: str | None) -> "JointRanges":
        """Return the ranges of the arm with the name ``arm``; the ranges of this arm if it is None."""
        return self if arm is None else replace(self.arms[arm], name=arm)

    def unknown_names(self, names: Iterable[str]) -> list[str]:
        """Return an error for each name that is neither a joint nor a group."""
        known = {*self.joints, *self.groups}
        return [
            f"the {self.name} has no joint or group '{name}'{_similar_name(name, known)}"
            for name in dict.fromkeys(names)
            if name not in known
        ]

    def missing_joints(self, joints: Iterable[str]) -> list[str]:
        """Return errors for the names that are not joints."""
        return self._no_joints(name for name in dict.fromkeys(joints) if name not in self.joints)

    def resolve(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return the joints of ``names`` with groups expanded, each once; all joints if ``names`` is empty.

        Raises BadRequest that lists every unknown name.
        """
        names = tuple(names)
        if wrong := self.unknown_names(names):
            raise BadRequest("; ".join(wrong))
        if not names:
            return tuple(self.joints)
        return tuple(dict.fromkeys(joint for name in names for joint in self.groups.get(name, (name,))))

    def limit_violations(self, poses: Iterable[Mapping[str, float]]) -> list[str]:
        """Return an error for each joint in ``poses`` (radians) that the arm lacks or that exceeds its limits."""
        poses = list(poses)
        wrong: dict[str, str] = {}
        for pose in poses:
            for joint, angle in pose.items():
                limits = self.joints.get(joint)
                if joint in wrong or limits is None:
                    continue
                if not limits.lower - LIMIT_TOLERANCE <= angle <= limits.upper + LIMIT_TOLERANCE:
                    ends = f"{degrees_text(limits.lower)} to {degrees_text(limits.upper)}"
                    wrong[joint] = f"{joint} at {degrees_text(angle)} is outside its limits ({ends})"
        return [*self.missing_joints(joint for pose in poses for joint in pose), *wrong.values()]

    def speed_violations(self, speeds: Mapping[str, float]) -> list[str]:
        """Return an error for each joint whose speed (rad/s) exceeds its limit."""
        return [
            f"{joint} at {degrees_text(speed)}/s exceeds its maximum speed ({degrees_text(self.joints[joint].speed)}/s)"
            for joint, speed in speeds.items()
            if joint in self.joints and speed > self.joints[joint].speed + LIMIT_TOLERANCE
        ]

    def _no_joints(self, names: Iterable[str]) -> list[str]:
        names = list(names)
        groups = [name for name in names if name in self.groups]
        missing = [f"'{name}'{_similar_name(name, self.joints)}" for name in names if name not in self.groups]
        errors = [f"'{name}' is a group of joints, and here each needs its own angle" for name in groups]
        joints = "joint" if len(missing) == 1 else "joints"
        return [*errors, *([f"the {self.name} has no {joints} {', '.join(missing)}"] if missing else [])]


def _similar_name(name: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, sorted(known), n=1, cutoff=MIN_SIMILARITY)
    return f" (did you mean '{close[0]}'?)" if close else ""


def degrees_text(angle: float) -> str:
    """Return an angle (radians) as text: "12.5 deg"."""
    return f"{round(math.degrees(angle), 1) + 0.0:g} deg"
