"""Leaves that move the head."""

import math

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import HeadPose

ARRIVED = math.radians(1.0)
"""Within this angle the head has arrived; a hobby servo takes whole degrees."""


class Look(Leaf):
    """Turn the head.

    Running until the head looks there (or as near as its limits allow), then succeeds.
    """

    word = "look"
    needs = frozenset({"head"})
    drives = frozenset({"head"})
    pan: float = argument("angle", "positive is to the left", default=0.0, principal=True)
    tilt: float = argument("angle", "positive is down", default=0.0)
    _goal: HeadPose | None = None

    def initialise(self) -> None:
        self._goal = self.robot.head.look(HeadPose(self.pan, self.tilt))

    def update(self) -> Status:
        if self._goal is None:
            return self.wait("waiting for the head")
        if arrived(self.robot.head.pose().value, self._goal):
            return SUCCESS
        return self.wait("the head is on its way")

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()


def arrived(pose: HeadPose | None, goal: HeadPose) -> bool:
    """True when ``pose`` is at ``goal``, as nearly as the servos can."""
    return pose is not None and abs(pose.pan - goal.pan) <= ARRIVED and abs(pose.tilt - goal.tilt) <= ARRIVED
