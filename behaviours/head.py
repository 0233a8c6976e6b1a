"""Leaves that move the head."""

import math

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import HeadPose, Reading

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

    def update(self) -> Status:
        # Said at every tick: a head that was gone for a moment has forgotten where to look.
        goal = self.robot.head.look(HeadPose(self.pan, self.tilt))
        return SUCCESS if arrived(self.robot.head.pose(), goal) else self.wait("the head is on its way")

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()


def arrived(reading: Reading[HeadPose], goal: HeadPose) -> bool:
    """True when the head is known to be at ``goal``, as nearly as its servos can."""
    pose = reading.value
    if pose is None or not reading.good:
        return False
    return abs(pose.pan - goal.pan) <= ARRIVED and abs(pose.tilt - goal.tilt) <= ARRIVED
