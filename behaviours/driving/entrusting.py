"""Motions that nodes of ROS 2 do where the robot has some that can: begun, watched, cancelled, and waited for."""

import math
from abc import abstractmethod

from py_trees.common import Status

from behaviours.driving.motion import NO_PROGRESS_LIMIT, Motion, held_up
from behaviours.leaf import SUCCESS
from behaviours.requesting import INTERRUPTED, ended
from drivers.api import BaseState, GoalState, Pose2D, Ros2

PROGRESS_WAY, PROGRESS_TURN = 0.05, math.radians(10)
"""Metres and radians that count as progress."""

NO_PROGRESS = f"no progress for {NO_PROGRESS_LIMIT:g} s"


class Entrusting(Motion):
    """A motion that ends as the action that ``entrust`` has begun; without one, by itself.

    While the base is latched it begins none; latched under way, it fails. Halted, it cancels that and waits for its
    end, and it cancels it where it fails. Paused, it cancels it as well, and begins it again at the next tick.
    """

    uses = frozenset({"ros2"})
    halt_limit = 3.0
    _goal: int | None = None
    _seen_at: Pose2D | None = None  # where the base was when it last made progress
    _cancelled_at: float | None = None  # when a pause has cancelled the action

    def initialise(self) -> None:
        super().initialise()
        self._goal = self._seen_at = self._cancelled_at = None
        if self.robot.ros2_part is not None and not self.robot.base.latched:
            self._goal = self.entrust(self.robot.ros2_part)

    @abstractmethod
    def entrust(self, nodes: Ros2) -> int | None:
        """Begin an action, where ``nodes`` offer it; return its number."""

    def finished(self, state: BaseState | None) -> bool:
        """Whether nothing is left to be entrusted after a pause."""
        del state
        return False

    @abstractmethod
    def watch(self, state: BaseState) -> str:
        """Keep what it has come to; say what is done."""

    def update(self) -> Status:
        latched = held_up(self.robot.base)
        if latched:
            return self.fail(latched)
        if self._goal is None:
            return super().update()
        if self._cancelled_at is not None:
            if not ended(self.robot.ros2, self._goal, self.run.now() - self._cancelled_at):
                return self.wait("waiting for the cancelled action to end")
            if self.robot.ros2.progress(self._goal).state in INTERRUPTED:
                return self._entrust_again()
            self._cancelled_at = None
        state, progress = self.state(), self.robot.ros2.progress(self._goal)
        doing = "waiting for the base to report" if state is None else self.watch(state)
        if not progress.over:
            return self.fail(NO_PROGRESS) if self._stuck(state) else self.wait(doing)
        self.robot.base.stop()
        return SUCCESS if progress.state is GoalState.SUCCEEDED else self.fail(progress.reason or str(progress.state))

    def _entrust_again(self) -> Status:
        """Begin the action anew, without driving there by itself should nobody offer it any more."""
        goal = self.entrust(self.robot.ros2)
        if goal is None and not self.finished(self.state()):
            return self.fail("the action is not offered any more: what drove the base has gone")
        self._goal, self._seen_at, self._cancelled_at = goal, None, None
        self._clock.restart()
        return self.wait("begun again")

    def on_pause(self) -> None:
        if self._goal is None or self.robot.ros2.progress(self._goal).over:
            return
        self._cancelled_at = self.run.now()
        self.robot.ros2.cancel(self._goal)
        self.robot.base.stop()

    def _stuck(self, state: BaseState | None) -> bool:
        """Return whether the base has stood still for too long."""
        if state is None:
            self._clock.stop()
            return False
        here, before = state.pose, self._seen_at
        away = math.inf if before is None else math.hypot(here.x - before.x, here.y - before.y)
        if before is None or away > PROGRESS_WAY or abs(here.heading - before.heading) > PROGRESS_TURN:
            self._seen_at = here
            self._clock.restart()
        return self._clock.run(self.run.now(), self.robot.base.steering()) > NO_PROGRESS_LIMIT

    def terminate(self, new_status: Status) -> None:
        if self._goal is not None and new_status is not SUCCESS:
            self.robot.ros2.cancel(self._goal)
        super().terminate(new_status)

    def halting(self) -> bool:
        return self._goal is not None and not self.robot.ros2.progress(self._goal).over
