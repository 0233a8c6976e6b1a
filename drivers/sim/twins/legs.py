"""The twin of a base that walks: the real driver's rules and engine on the twins of the joints, in one thread."""

from collections.abc import Callable, Mapping
from math import cos, sin
from types import MappingProxyType
from typing import Literal, Unpack

from drivers.api import Joints, Pose2D, Velocity
from drivers.clock import Clock
from drivers.kobuki.steered import Settings
from drivers.legs.compensation import Compensation
from drivers.legs.driver import LegsBase
from drivers.legs.engine import Engine, Felt


class LegsTwin(LegsBase):
    """A ``LegsBase`` without a thread. In the world it is where its steps have led it from its ``start``."""

    def __init__(
        self,
        joints: Joints,
        clock: Clock,
        engine: Engine,
        *,
        start: Pose2D,
        felt: Callable[[], Felt | None] = lambda: None,
        compensation: Compensation | None = None,
        torques: Mapping[str, float] = MappingProxyType({}),
        at_fall: Literal["relax", "hold"] = "relax",
        **settings: Unpack[Settings],
    ) -> None:
        super().__init__(
            joints,
            clock,
            engine,
            felt=felt,
            compensation=compensation,
            torques=torques,
            at_fall=at_fall,
            **settings,
        )
        self._start = start

    def true_pose(self, now: float) -> Pose2D:
        """Where it is at time ``now``, in the world's frame."""
        del now
        pose, start = self._engine.pose[0], self._start
        c, s = cos(start.heading), sin(start.heading)
        x, y = start.x + c * pose.x - s * pose.y, start.y + s * pose.x + c * pose.y
        return Pose2D(x, y, start.heading + pose.heading)

    @property
    def true_velocity(self) -> Velocity:
        """How fast it really goes."""
        ahead, _, turn = self._engine.pose[1]
        return Velocity(ahead, turn)
