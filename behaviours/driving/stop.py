"""The leaf that stops the base."""

from py_trees.common import Status

from behaviours.driving.motion import REACTION, STANDSTILL, Motion
from behaviours.leaf import SUCCESS
from drivers.api import BaseState, Pose2D

STOP_LIMIT = 5.0
"""Seconds within which a base must stand that was stopped."""


class Stop(Motion):
    """Stop the base.

    Running until it stands still, then succeeds; fails when it still moves after 5 s.
    """

    word = "stop"

    def initialise(self) -> None:
        super().initialise()
        self.robot.base.stop()

    def update(self) -> Status:
        state = self.state()  # whoever else has the wheels, or whatever it feels: it is to stand
        if state is None:
            return self.wait("waiting for the base to report")
        return self.go(state, state.pose)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        moving = max(abs(state.velocity.linear), abs(state.velocity.angular))
        # What it was told a moment before may still be on its way to the wheels.
        if moving < STANDSTILL and self.elapsed >= REACTION:
            return SUCCESS
        if self.elapsed > STOP_LIMIT:
            return self.fail(f"the base still moves {STOP_LIMIT:g} s after it was stopped")
        return self.wait("stopping")
