"""The leaf that drives to a place."""

import math
from abc import abstractmethod

from py_trees.common import Status

from behaviours.driving.motion import (
    CRAWL,
    NO_PROGRESS_LIMIT,
    Motion,
    Spin,
    Way,
    held_up,
    seconds_to_drive,
    seconds_to_turn,
)
from behaviours.leaf import SUCCESS, argument
from behaviours.requesting import INTERRUPTED, ended
from drivers.api import BaseState, GoalState, Length, Pose2D, Ros2, Velocity
from drivers.api.measures import length_text
from drivers.api.ros2 import START

# Motions that nodes of ROS 2 do where the robot has some that can: begun, watched, cancelled, and waited for.

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


TURN_SPEED = math.radians(60)
"""rad/s at which it turns at most."""

EAGERNESS = 2.5
"""rad/s for each radian that the place is beside straight ahead."""

ASIDE = math.radians(20)
"""With the place further aside it turns on the spot."""

TRIES = 3
"""How often it drives up to the place, should it miss it."""


class GoTo(Entrusting, Spin):
    """Drive to a place in a straight line, by odometry, and turn to a heading there.

    Running until it stands there, then succeeds. A robot of ROS 2 that has Nav2 drives there by that, around what is
    in the way and at Nav2's own speed; then it ends as `navigate` does. Others know of nothing that is in the way: it
    fails when it bumps into something or comes to a cliff, when a wheel drops, while the base is stopped until somebody
    enables it, and when it has missed the place three times. While somebody steers the base by hand it waits, then
    drives there from elsewhere. On a base that measures nothing it ends where its commands should have led it, and
    says so: "by dead reckoning".
    """

    word = "go_to"
    stores = "how far from the place it stands, by odometry (m)"
    keeps = Length
    x: float = argument("length", "metres ahead of where the base started: what `base.x` will be")
    y: float = argument("length", "metres to the left of where it started: what `base.y` will be")
    heading: float | None = argument(
        "angle", "how to stand there, as `base.heading` counts; else as it comes", default=None
    )
    speed: float = argument("speed", "how fast", default=0.2, low=0.01, high=0.7)
    tolerance: float = argument("length", "how far beside the place is near enough", default=0.02, low=0.005)
    _there = False
    _turns = True  # to the place, before it drives there
    _facing: float | None = None  # the heading to turn to, among those that are the same the nearest
    _side = 1.0  # to which it turns
    _tries = 0

    @property
    def way(self) -> Way:
        return Way.ROUND if self._there or self._turns else Way.AHEAD

    def initialise(self) -> None:
        super().initialise()
        self._there, self._turns, self._facing, self._tries = False, True, None, 0

    def entrust(self, nodes: Ros2) -> int | None:
        if not nodes.navigates():
            return None
        state, heading = self.state(), self.heading
        if heading is None and state is not None:
            heading = math.atan2(self.y - state.pose.y, self.x - state.pose.x)
        return nodes.navigate(((self.x, self.y, heading or 0.0),), START)

    def watch(self, state: BaseState) -> str:
        self.result = math.hypot(self.x - state.pose.x, self.y - state.pose.y)
        return f"{length_text(self.result)} to go, by Nav2"

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        self._there, self._turns, self._facing, self._tries = False, True, None, 0

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        del start
        away, limits = math.hypot(self.x - state.pose.x, self.y - state.pose.y), self.robot.base.limits
        # It turns to the place and at it, and may miss it.
        return seconds_to_drive(away, self.speed, limits) + TRIES * seconds_to_turn(math.pi, TURN_SPEED, limits)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        pose = state.pose
        dx, dy = self.x - pose.x, self.y - pose.y
        away = self.result = math.hypot(dx, dy)
        if self._there:
            return self._face(state)
        aside = math.remainder(math.atan2(dy, dx) - pose.heading, math.tau)
        near, doing = away <= self.tolerance, f"{length_text(away)} to go"
        turn = max(-TURN_SPEED, min(TURN_SPEED, EAGERNESS * aside))
        self._turns = not near and not self._stopping and abs(aside) > ASIDE
        if self._turns:
            return self.steer(Velocity(0.0, turn), doing)
        speed = self.approach(away * math.cos(aside), braking=self.braking, crawl=CRAWL)
        if speed > 0.0:
            return self.steer(Velocity(min(speed, self.speed), 0.0 if near else turn), doing)
        if self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular))) is not SUCCESS:
            return self.wait("stopping")
        return self._arrived(near=near, state=state)

    def _arrived(self, *, near: bool, state: BaseState) -> Status:
        """Go on to the heading; or once more to the place, where it was missed."""
        self._stopping = False
        if near:
            self._there = True
            return self._face(state)
        self._tries += 1
        if self._tries == TRIES:
            missed = self.result if isinstance(self.result, float) else 0.0
            return self.fail(f"missed the place by {length_text(missed)}")
        return self.wait("missed the place: once more")

    def _face(self, state: BaseState) -> Status:
        if self.heading is None:
            return SUCCESS
        if self._facing is None:
            now = state.pose.heading
            self._facing = now + math.remainder(self.heading - now, math.tau)
            self._side = math.copysign(1.0, self._facing - now)
        return self.turn_to(
            self._facing, self._side, TURN_SPEED, state, f"turning to {math.degrees(self.heading):.0f} deg"
        )
