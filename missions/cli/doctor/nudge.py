"""The leaf that tries a joint: a little way to and fro, gently, from where it stands."""

import math
from collections.abc import Mapping

from py_trees.common import Status

from behaviours.joint_motion import ON_ARM, JointMotion, positions
from behaviours.joint_ranges import JointRanges
from behaviours.leaf import RUNNING, SUCCESS, argument
from behaviours.tracking_error import Sample

WAY = math.radians(4.0)
"""How far a joint goes."""

DURATION = 2.0
"""Seconds for to and fro."""

SETTLING = 0.5
"""Seconds after which what it did is known."""


class There:
    """A little way and back, without a jerk."""

    def __init__(self, start: Mapping[str, float], way: float) -> None:
        self._start, self._way = start, way

    def at(self, time: float) -> Mapping[str, float]:
        """Return where the joint is to be."""
        share = math.sin(math.pi * min(max(time / DURATION, 0.0), 1.0)) ** 2
        return {joint: angle + self._way * share for joint, angle in self._start.items()}


class Nudge(JointMotion):
    """Move a joint a little way and back.

    Running for some seconds, then succeeds. Fails where the joint stands outside its limits, by more than it sags,
    before it moves; and where it was not felt to move.
    """

    word = "nudge"
    joint: str = argument("joint", "which joint", principal=True)
    on: str = ON_ARM
    _begun: Mapping[str, float]
    _moved = 0.0

    def joint_violations(self, reach: JointRanges) -> list[str]:
        """Return that the arm has no such joint."""
        return reach.lacking((self.joint,))

    def moved(self) -> tuple[str, ...]:
        """Return the one joint."""
        return (self.joint,)

    def update(self) -> Status:
        """Look first whether the joint stands where it may."""
        here = positions(self.robot.arm).get(self.joint)
        if self._path is None and here is not None:
            limits = self.robot.arm.limits[self.joint]
            if not limits.lower - WAY <= here <= limits.upper + WAY or limits.upper - limits.lower < WAY:
                ends = f"{math.degrees(limits.lower):.0f} to {math.degrees(limits.upper):.0f} deg"
                return self.fail(f"it stands at {math.degrees(here):.0f} deg; its limits are {ends}")
        return super().update()

    def path(self, start: Mapping[str, float]) -> There:
        """Return the way to and fro: upwards, where there is room."""
        self._begun, self._moved = start, 0.0
        room = self.robot.arm.limits[self.joint].upper - start[self.joint] >= WAY
        return There(start, WAY if room else -WAY)

    def follow(self, time: float, samples: Mapping[str, Sample]) -> Status:
        """Go on until it is back; then say whether it was felt to move."""
        if self.joint in samples:
            self._moved = max(self._moved, abs(samples[self.joint].position - self._begun[self.joint]))
        if time < DURATION + SETTLING:
            return RUNNING
        if self._moved < WAY / 4:
            return self.fail(f"it was sent {math.degrees(WAY):.0f} deg, and went {math.degrees(self._moved):.1f}")
        return SUCCESS
