"""Goals kept within the limits of their joints, and those told that were not."""

from collections.abc import Mapping
from math import degrees, inf

from drivers.api import DeviceStatus, Report
from drivers.dynamixel.joint import Joint

EPISODE = 10.0
"""Seconds without a goal beyond the limits of a joint after which the next one is worth a word again."""


class Clamping:
    """The limits of ``joints`` as goals meet them. Safe between threads, but for a notice told twice."""

    def __init__(self, name: str, joints: Mapping[str, Joint], report: Report) -> None:
        self._name = name
        self._joints = joints
        self._report = report
        self._clamped_at: dict[str, float] = {}

    def accept(self, goals: Mapping[str, float], now: float) -> dict[str, float]:
        """Return the nearest ``goals`` (rad) within the limits; tell, once an episode, of those that are others."""
        accepted = {}
        for name, goal in goals.items():
            joint = self._joints[name]
            limits = joint.limits
            if limits.lower <= goal <= limits.upper:
                accepted[name] = goal
            else:
                accepted[name] = joint.clamp(goal)
                if abs(accepted[name] - goal) > joint.model.tick / 2:  # less is rounding, and moves nothing
                    self._tell(joint, goal, now)
        return accepted

    def _tell(self, joint: Joint, goal: float, now: float) -> None:
        before = self._clamped_at.get(joint.name, -inf)
        self._clamped_at[joint.name] = now
        if now - before < EPISODE:
            return
        limits = joint.limits
        what = f"the goal of {joint.name} was clamped to {degrees(joint.clamp(goal)):.1f} deg: {degrees(goal):.1f} deg"
        span = f"{degrees(limits.lower):.1f}..{degrees(limits.upper):.1f} deg"
        hint = f"{joint.name} may go {span}: change what is asked of it, or its limits in the robot file"
        self._report(DeviceStatus(self._name, "fault", f"{what} is beyond its limits", hint))
