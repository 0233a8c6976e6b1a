"""What an arm has, and how far and fast it goes: joints by name and group, for leaves and for the checker."""

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import field, replace

from drivers.api import JointLimits
from drivers.api.quick import dataclass
from drivers.errors import BadRequest

LIKE = 0.75
"""As much of two names must be alike for a slip: what is proposed moves, and an elbow is not the right elbow."""

SLACK = 1e-6
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

    def of(self, arm: str | None) -> "JointRanges":
        """Return those of another ``arm`` of the robot, which has it; these where it is None."""
        return self if arm is None else replace(self.arms[arm], name=arm)

    def unknown(self, names: Iterable[str]) -> list[str]:
        """Return a mistake for each name that means neither a joint nor a group."""
        known = {*self.joints, *self.groups}
        return [
            f"the {self.name} has no joint or group '{name}'{_meant(name, known)}"
            for name in dict.fromkeys(names)
            if name not in known
        ]

    def lacking(self, joints: Iterable[str]) -> list[str]:
        """Return what is wrong with the names that are none of a joint."""
        return self._no_joints(name for name in dict.fromkeys(joints) if name not in self.joints)

    def named(self, names: Iterable[str]) -> tuple[str, ...]:
        """Return the joints that ``names`` mean, groups spelt out, each once; all joints where there is no name.

        Raises BadRequest with every name that means nothing.
        """
        names = tuple(names)
        if wrong := self.unknown(names):
            raise BadRequest("; ".join(wrong))
        if not names:
            return tuple(self.joints)
        return tuple(dict.fromkeys(joint for name in names for joint in self.groups.get(name, (name,))))

    def beyond(self, poses: Iterable[Mapping[str, float]]) -> list[str]:
        """Return a mistake for the joints in ``poses`` (radians) that the arm lacks, and for each asked too far."""
        poses = list(poses)
        wrong: dict[str, str] = {}
        for pose in poses:
            for joint, angle in pose.items():
                limits = self.joints.get(joint)
                if joint in wrong or limits is None:
                    continue
                if not limits.lower - SLACK <= angle <= limits.upper + SLACK:
                    ends = f"{degrees(limits.lower)} to {degrees(limits.upper)}"
                    wrong[joint] = f"{joint} at {degrees(angle)} is outside its limits ({ends})"
        return [*self.lacking(joint for pose in poses for joint in pose), *wrong.values()]

    def too_fast(self, speeds: Mapping[str, float]) -> list[str]:
        """Return a mistake for each joint that is to go faster (rad/s) than it can."""
        return [
            f"{joint} at {degrees(speed)}/s is faster than it goes ({degrees(self.joints[joint].speed)}/s)"
            for joint, speed in speeds.items()
            if joint in self.joints and speed > self.joints[joint].speed + SLACK
        ]

    def _no_joints(self, names: Iterable[str]) -> list[str]:
        names = list(names)
        groups = [name for name in names if name in self.groups]
        missing = [f"'{name}'{_meant(name, self.joints)}" for name in names if name not in self.groups]
        told = [f"'{name}' is a group of joints, and here each needs its own angle" for name in groups]
        joints = "joint" if len(missing) == 1 else "joints"
        return [*told, *([f"the {self.name} has no {joints} {', '.join(missing)}"] if missing else [])]


def _meant(name: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, sorted(known), n=1, cutoff=LIKE)
    return f" (did you mean '{close[0]}'?)" if close else ""


def degrees(angle: float) -> str:
    """Write an angle (radians) for a message: "12.5 deg"."""
    return f"{round(math.degrees(angle), 1) + 0.0:g} deg"
