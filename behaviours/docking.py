"""The leaf that drives the base onto its dock."""

from py_trees.common import Status

from behaviours.driving.entrusting import Entrusting
from behaviours.driving.motion import Way, obstacle
from behaviours.homing import SWEEP, Homing, Stage, step
from behaviours.leaf import SUCCESS, argument
from drivers.api import BaseState, Pose2D, Ros2, Steering

SETTLED = 0.4
"""Seconds on the contacts after which it is sure of them: twenty reports of a Kobuki."""


ACTION = "dock"
"""What a Create 3 offers for it."""


DOCK_TIME = 100.0
"""Seconds in which a base finds its dock within hearing, and reaches it, at the third try perhaps, at 0.1 m/s."""


class Dock(Entrusting):
    """Drive the base onto its dock, by the dock's infrared beams, or by the robot's own action.

    Running until the base stands on the contacts, then succeeds; at once, if it does so already. A robot of ROS 2 that
    has an action `dock`, as a Create 3 does, goes there by that, and it ends as that does. For others, the dock must be
    within hearing: some two metres, and not behind anything. Fails when it hears no dock in a full turn, when it has
    missed the contacts three times, when something is in its way, at a cliff, when a wheel drops, and while the base is
    stopped until somebody enables it. While somebody steers the base by hand it waits, then looks for the dock anew.
    """

    word = "dock"
    stores = "how full the battery is (percent)"
    keeps = float
    speed: float = argument("speed", "how fast until it is near", default=0.1, low=0.02, high=0.3)
    _homing: Homing | None = None
    _docked_since: float | None = None

    def initialise(self) -> None:
        super().initialise()
        self._homing = self._docked_since = None

    def entrust(self, nodes: Ros2) -> int | None:
        state = self.state()
        if (state is not None and state.docked) or not nodes.does(ACTION):
            return None
        return nodes.begin(ACTION, "irobot_create_msgs/action/Dock", "{}")

    def finished(self, state: BaseState | None) -> bool:
        return state is not None and state.docked

    def watch(self, state: BaseState) -> str:
        self.result = state.battery_percent
        return "it docks by itself"

    def trouble(self, state: BaseState, steering: Steering) -> str:
        stage = None if self._homing is None else self._homing.stage
        # What it touches on its way to the dock is the dock; and there is no edge where it stands on that.
        return obstacle(state, Way.AHEAD if stage is Stage.CROSS else Way.ROUND, steering)

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        if self._homing is not None and self._homing.stage is not Stage.DRIVE:
            self._homing = None

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        del state, start
        limits = self.robot.base.limits
        return DOCK_TIME * max(1.0, 0.1 / min(self.speed, limits.speed), SWEEP / limits.turn)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        now = self.run.now()
        if state.docked:
            return self._settle_on_it(state, now)
        self._docked_since, self._stopping = None, False
        homing = self._homing or Homing(state.pose, now)
        self._homing, velocity = step(homing, state, now, self.speed)
        if self._homing.failure:
            return self.fail(self._homing.failure)
        return self.steer(velocity, self._homing.stage.value)

    def _settle_on_it(self, state: BaseState, now: float) -> Status:
        if self._docked_since is None:
            self._docked_since = now
        resting = self.come_to_rest(state.velocity.linear)
        if resting is not SUCCESS or now - self._docked_since < SETTLED:
            return self.wait("on the dock")
        self.result = state.battery_percent
        return SUCCESS
