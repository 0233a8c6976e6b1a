"""Leaves of the faulty missions."""

from py_trees.common import Status

from behaviours.leaf import RUNNING, Leaf
from drivers.api import Velocity


class RollAway(Leaf):
    """Roll, and never say stop.

    Running until it fails for want of floor.
    """

    tag = "roll_away"
    needs = frozenset({"base"})
    drives = frozenset({"base"})
    ends = frozenset({"failure"})

    def update(self) -> Status:
        self.robot.base.drive(Velocity(0.1, 0.0))
        return RUNNING

    def terminate(self, new_status: Status) -> None:
        pass


class RollOn(RollAway):
    """Roll until halted."""

    tag = "roll_on"
    ends = frozenset()

    def terminate(self, new_status: Status) -> None:
        del new_status
        self.robot.base.stop()


class Dither(RollAway):
    """Say for ever that it still stops."""

    tag = "dither"
    ends = frozenset({"success", "failure"})

    def halting(self) -> bool:
        return True

    def terminate(self, new_status: Status) -> None:
        del new_status
        self.robot.base.stop()
