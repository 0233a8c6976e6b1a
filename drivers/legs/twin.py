"""Simulated walking base: runs the driver's rules and walking engine on simulated joints, in one thread."""

from math import cos, sin

from drivers.api import Pose2D, Velocity
from drivers.base.arbitrated import settings_of
from drivers.legs.declared import LegsKeys
from drivers.legs.driver import LegsBase
from drivers.legs.make import attitude_reader, make_compensation, make_engine, stall_torques
from drivers.sim.context import SimContext


class LegsTwin(LegsBase):
    """A ``LegsBase`` without a thread. Its true pose in the world follows from its steps, beginning at ``start``."""

    start = Pose2D(0.0, 0.0, 0.0)

    def true_pose(self, now: float) -> Pose2D:
        """Return the true pose of the base at time ``now``, in the world's frame."""
        del now
        pose, start = self._engine.pose[0], self.start
        c, s = cos(start.heading), sin(start.heading)
        x, y = start.x + c * pose.x - s * pose.y, start.y + s * pose.x + c * pose.y
        return Pose2D(x, y, start.heading + pose.heading)

    @property
    def true_velocity(self) -> Velocity:
        """True velocity of the base."""
        ahead, _, turn = self._engine.pose[1]
        return Velocity(ahead, turn)


def make(keys: LegsKeys, stage: SimContext) -> LegsTwin:
    """Return the simulated walking base on the arm's twin."""
    joints, walks = stage.parts["arm"], make_engine(keys)
    twin = LegsTwin(
        joints,
        stage.clock,
        walks,
        read_attitude=attitude_reader(stage.parts.get("imu")),
        compensation=None if stage.scene is None else make_compensation(walks, joints),
        torques=stall_torques(walks, joints),
        at_fall=keys.at_fall,
        tucked=keys.body.tucked_angles,
        **settings_of(keys, stage),
    )
    if stage.world is not None:
        twin.start = stage.world.start
    return twin
