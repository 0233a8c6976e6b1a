"""What an arm has, and how far and fast it goes: joints by name and group, for leaves and for the checker."""

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
"""The default of an argument that must be given."""


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of a leaf.

    ``kind`` is a dimension ("angle", "length", "duration", ...), "text", "number", "count", "flag", "value" (anything),
    "outcomes" (a list of statuses), "joint" (a name), "joints" (a joint, a group of them, or a list of both), or
    "gesture", "move", "gait", "controller" or "object" (looked up by name), "new move" (the name of what is to be
    recorded), "file" (a path from the mission's folder), "face" (a variable that holds one, or nothing), "phrases"
    (what may be said: one text, or a list of them, known before the mission starts), "choice" (one of the words in
    ``choices``), or a kind of part of which a robot may have several, "head" or "arm": its name, and the leaf sees that
    one as its robot's only one.
    ``span`` asks for two values, [low, high]; ``by_joint`` for one value for each of some joints, {elbow: 30 deg}.
    ``low`` and ``high`` are bounds in SI units. The ``principal`` one may be written without its name.
    ``attribute`` is the leaf's attribute that holds the value.
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
        """True when a mission must give it."""
        return self.default is REQUIRED


def argument(kind: str, help: str, *, name: str = "", **options: Any) -> Any:  # noqa: A002 - as argparse and click
    """Declare an argument of a leaf, as a class attribute.

    ``speed: float = argument("speed", "how fast", default=0.2)``. When the leaf starts, the attribute holds the value:
    SI floats for quantities, a pair of them for a span, a mapping for values by joint, a tuple of names for joints, and
    for phrases a mapping from how each is listened for to how it is written.
    ``called`` is its name in missions where that cannot be the attribute's, as ``name``, which every node has.
    """
    return Argument(name=name, kind=kind, help=help, **options)


MIN_SIMILARITY = 0.75
"""As much of two names must be alike for a slip: what is proposed moves, and an elbow is not the right elbow."""

LIMIT_TOLERANCE = 1e-6
"""Radians by which an angle may lie beyond a limit: what is written in degrees is not exact."""


@dataclass(frozen=True, slots=True)
class JointRanges:
    """The range of each joint, by name, in the order of the robot file; ``groups`` of joints go by one name.

    ``arms`` are those of all arms of a robot that has several, by name, for what has to do with two; ``name`` is what
    this one is called in messages.
    """

    joints: Mapping[str, JointLimits]
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    arms: Mapping[str, "JointRanges"] = field(default_factory=dict)
    name: str = "arm"

    def of_arm(self, arm: str | None) -> "JointRanges":
        """Return those of another ``arm`` of the robot, which has it; these where it is None."""
        return self if arm is None else replace(self.arms[arm], name=arm)

    def unknown_names(self, names: Iterable[str]) -> list[str]:
        """Return a mistake for each name that means neither a joint nor a group."""
        known = {*self.joints, *self.groups}
        return [
            f"the {self.name} has no joint or group '{name}'{_similar_name(name, known)}"
            for name in dict.fromkeys(names)
            if name not in known
        ]

    def missing_joints(self, joints: Iterable[str]) -> list[str]:
        """Return what is wrong with the names that are none of a joint."""
        return self._no_joints(name for name in dict.fromkeys(joints) if name not in self.joints)

    def resolve(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return the joints that ``names`` mean, groups spelt out, each once; all joints where there is no name.

        Raises BadRequest with every name that means nothing.
        """
        names = tuple(names)
        if wrong := self.unknown_names(names):
            raise BadRequest("; ".join(wrong))
        if not names:
            return tuple(self.joints)
        return tuple(dict.fromkeys(joint for name in names for joint in self.groups.get(name, (name,))))

    def limit_violations(self, poses: Iterable[Mapping[str, float]]) -> list[str]:
        """Return a mistake for the joints in ``poses`` (radians) that the arm lacks, and for each asked too far."""
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
        """Return a mistake for each joint that is to go faster (rad/s) than it can."""
        return [
            f"{joint} at {degrees_text(speed)}/s is faster than it goes ({degrees_text(self.joints[joint].speed)}/s)"
            for joint, speed in speeds.items()
            if joint in self.joints and speed > self.joints[joint].speed + LIMIT_TOLERANCE
        ]

    def _no_joints(self, names: Iterable[str]) -> list[str]:
        names = list(names)
        groups = [name for name in names if name in self.groups]
        missing = [f"'{name}'{_similar_name(name, self.joints)}" for name in names if name not in self.groups]
        told = [f"'{name}' is a group of joints, and here each needs its own angle" for name in groups]
        joints = "joint" if len(missing) == 1 else "joints"
        return [*told, *([f"the {self.name} has no {joints} {', '.join(missing)}"] if missing else [])]


def _similar_name(name: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, sorted(known), n=1, cutoff=MIN_SIMILARITY)
    return f" (did you mean '{close[0]}'?)" if close else ""


def degrees_text(angle: float) -> str:
    """Write an angle (radians) for a message: "12.5 deg"."""
    return f"{round(math.degrees(angle), 1) + 0.0:g} deg"
