"""The leaf that stops the base."""

from py_trees.common import Status

from behaviours.driving.motion import REACTION, STANDSTILL, Motion
from behaviours.leaf import SUCCESS
from drivers.api import BaseState, Pose2D


class Stop(Motion):
    """Stop the base.

    Running until it stands still, then succeeds.
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
        return SUCCESS if moving < STANDSTILL and self.elapsed >= REACTION else self.wait("stopping")
