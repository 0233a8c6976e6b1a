"""Leaf that drives to a place, and the base class of motions that a ROS 2 action can take over."""

import math
from abc import abstractmethod

from py_trees.common import Status

from behaviours.driving.motion import (
    CRAWL_SPEED,
    NO_PROGRESS_TIMEOUT,
    BaseMotion,
    MotionDirection,
    Spin,
    latch_reason,
    seconds_to_drive,
    seconds_to_turn,
)
from behaviours.leaf import SUCCESS, argument
from behaviours.ros2_request import CANCELLED_STATES, has_ended
from drivers.api import BaseState, GoalState, Length, Pose2D, Ros2, Velocity
from drivers.api.measures import length_text
from drivers.api.ros2 import START_FRAME

# Motions that nodes of ROS 2 do where the robot has some that can: begun, watched, cancelled, and waited for.

MIN_PROGRESS_DISTANCE, MIN_PROGRESS_ANGLE = 0.05, math.radians(10)
"""Distance in metres and angle in radians that count as progress."""

NO_PROGRESS_REASON = f"no progress for {NO_PROGRESS_TIMEOUT:g} s"


class DelegatedMotion(BaseMotion):
    """Base class of motions that use a ROS 2 action if the robot offers one, and drive by themselves otherwise.

    While the base is latched, no action starts. If the base is latched while the action runs, the leaf fails. A halt or
    failure cancels the action, and a halt waits for its end. A pause cancels the action too, and the next tick starts
    it again.
    """

    optional_parts = frozenset({"ros2"})
    halt_limit = 3.0
    _goal: int | None = None
    _seen_at: Pose2D | None = None  # where the base was when it last made progress
    _cancelled_at: float | None = None  # when a pause has cancelled the action

    def initialise(self) -> None:
        super().initialise()
        self._goal = self._seen_at = self._cancelled_at = None
        if self.robot.ros2_part is not None and not self.robot.base.latched:
            self._goal = self.delegate(self.robot.ros2_part)

    @abstractmethod
    def delegate(self, nodes: Ros2) -> int | None:
        """Start the ROS 2 action of this motion, and return its request number; None if ``nodes`` do not offer it."""

    def is_finished(self, state: BaseState | None) -> bool:
        """Return True if the motion is complete, so its action need not start again after a pause.

        False by default.
        """
        del state
        return False

    @abstractmethod
    def update_progress(self, state: BaseState) -> str:
        """Store the progress of the motion in ``result``, and return it as text for the leaf's reason."""

    def update(self) -> Status:
        latched = latch_reason(self.robot.base)
        if latched:
            return self.fail(latched)
        if self._goal is None:
            return super().update()
        if self._cancelled_at is not None:
            if not has_ended(self.robot.ros2, self._goal, self.run.now() - self._cancelled_at):
                return self.wait("waiting for the cancelled action to end")
            if self.robot.ros2.progress(self._goal).state in CANCELLED_STATES:
                return self._delegate_again()
            self._cancelled_at = None
        state, progress = self.state(), self.robot.ros2.progress(self._goal)
        activity = "waiting for the base to report" if state is None else self.update_progress(state)
        if not progress.is_final:
            return self.fail(NO_PROGRESS_REASON) if self._is_stuck(state) else self.wait(activity)
        self.robot.base.stop()
        return SUCCESS if progress.state is GoalState.SUCCEEDED else self.fail(progress.reason or str(progress.state))

    def _delegate_again(self) -> Status:
        """Start the action again after a pause; fail if the robot no longer offers it."""
        goal = self.delegate(self.robot.ros2)
        if goal is None and not self.is_finished(self.state()):
            return self.fail("the action is no longer offered: its server has disconnected")
        self._goal, self._seen_at, self._cancelled_at = goal, None, None
        self._clock.restart()
        return self.wait("begun again")

    def on_pause(self) -> None:
        if self._goal is None or self.robot.ros2.progress(self._goal).is_final:
            return
        self._cancelled_at = self.run.now()
        self.robot.ros2.cancel(self._goal)
        self.robot.base.stop()

    def _is_stuck(self, state: BaseState | None) -> bool:
        """Return True if the base has made no progress for ``NO_PROGRESS_TIMEOUT`` seconds."""
        if state is None:
            self._clock.stop()
            return False
        here, before = state.pose, self._seen_at
        away = math.inf if before is None else math.hypot(here.x - before.x, here.y - before.y)
        if before is None or away > MIN_PROGRESS_DISTANCE or abs(here.heading - before.heading) > MIN_PROGRESS_ANGLE:
            self._seen_at = here
            self._clock.restart()
        return self._clock.run(self.run.now(), self.robot.base.steering()) > NO_PROGRESS_TIMEOUT

    def terminate(self, new_status: Status) -> None:
        if self._goal is not None and new_status is not SUCCESS:
            self.robot.ros2.cancel(self._goal)
        super().terminate(new_status)

    def halting(self) -> bool:
        return self._goal is not None and not self.robot.ros2.progress(self._goal).is_final


MAX_TURN_RATE = math.radians(60)
"""Maximum turn rate of the base on its way to a place, in rad/s."""

TURN_GAIN = 2.5
"""Ratio (1/s) of the base's turn rate to the bearing of the place, on the way to a place."""

MAX_DRIVING_BEARING = math.radians(20)
"""Bearing of the place in radians beyond which the base turns on the spot instead of driving."""

MAX_TRIES = 3
"""Number of times that the base may miss the place before the leaf fails."""


class GoTo(DelegatedMotion, Spin):
    """Drive straight to a place by odometry, and turn to a heading there.

    Running until the base stands there, then succeeds. A ROS 2 robot with Nav2 uses Nav2, which drives around obstacles
    at its own speed; the leaf then ends as `navigate` does. All other bases drive straight: the leaf fails after a
    bump, at a cliff, when a wheel drops, while the base is latched, and after three misses of the place. While a person
    steers the base, it waits, then drives there from the new position. A base without odometry ends where its commands
    should have led it, and the reason says "by dead reckoning".
    """

    tag = "go_to"
    example = "- go_to: {x: 1 m, y: 0.5 m, heading: 90 deg}"
    output_doc = "the distance to the place by odometry (m)"
    output_type = Length
    x: float = argument("length", "position ahead of the base's start, as `base.x`")
    y: float = argument("length", "position to the left of the base's start, as `base.y`")
    heading: float | None = argument(
        "angle", "final heading, as `base.heading`; by default the heading of arrival", default=None
    )
    speed: float = argument("speed", "maximum speed", default=0.2, low=0.01, high=0.7)
    tolerance: float = argument("length", "distance from the place that counts as arrived", default=0.02, low=0.005)
    _at_place = False
    _turns = True  # to the place, before it drives there
    _facing: float | None = None  # the heading to turn to, among those that are the same the nearest
    _side = 1.0  # to which it turns
    _tries = 0

    @property
    def motion_direction(self) -> MotionDirection:
        return MotionDirection.ROUND if self._at_place or self._turns else MotionDirection.AHEAD

    def initialise(self) -> None:
        super().initialise()
        self._at_place, self._turns, self._facing, self._tries = False, True, None, 0

    def delegate(self, nodes: Ros2) -> int | None:
        if not nodes.navigates():
            return None
        state, heading = self.state(), self.heading
        if heading is None and state is not None:
            heading = math.atan2(self.y - state.pose.y, self.x - state.pose.x)
        return nodes.navigate(((self.x, self.y, heading or 0.0),), START_FRAME)

    def update_progress(self, state: BaseState) -> str:
        self.result = math.hypot(self.x - state.pose.x, self.y - state.pose.y)
        return f"{length_text(self.result)} to go, by Nav2"

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        self._at_place, self._turns, self._facing, self._tries = False, True, None, 0

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        del start
        away, limits = math.hypot(self.x - state.pose.x, self.y - state.pose.y), self.robot.base.limits
        # It turns to the place and at it, and may miss it.
        return seconds_to_drive(away, self.speed, limits) + MAX_TRIES * seconds_to_turn(math.pi, MAX_TURN_RATE, limits)

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        pose = state.pose
        dx, dy = self.x - pose.x, self.y - pose.y
        away = self.result = math.hypot(dx, dy)
        if self._at_place:
            return self._turn_to_heading(state)
        aside = math.remainder(math.atan2(dy, dx) - pose.heading, math.tau)
        near, activity = away <= self.tolerance, f"{length_text(away)} to go"
        turn = max(-MAX_TURN_RATE, min(MAX_TURN_RATE, TURN_GAIN * aside))
        self._turns = not near and not self._stopping and abs(aside) > MAX_DRIVING_BEARING
        if self._turns:
            return self.steer(Velocity(0.0, turn), activity)
        speed = self.approach(away * math.cos(aside), braking=self.braking, crawl=CRAWL_SPEED)
        if speed > 0.0:
            return self.steer(Velocity(min(speed, self.speed), 0.0 if near else turn), activity)
        if self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular))) is not SUCCESS:
            return self.wait("stopping")
        return self._on_arrival(near=near, state=state)

    def _on_arrival(self, *, near: bool, state: BaseState) -> Status:
        """Turn to the heading, or try again if the place was missed."""
        self._stopping = False
        if near:
            self._at_place = True
            return self._turn_to_heading(state)
        self._tries += 1
        if self._tries == MAX_TRIES:
            missed = self.result if isinstance(self.result, float) else 0.0
            return self.fail(f"missed the place by {length_text(missed)}")
        return self.wait("missed the place, trying again")

    def _turn_to_heading(self, state: BaseState) -> Status:
        if self.heading is None:
            return SUCCESS
        if self._facing is None:
            now = state.pose.heading
            self._facing = now + math.remainder(self.heading - now, math.tau)
            self._side = math.copysign(1.0, self._facing - now)
        return self.turn_to(
            self._facing, self._side, MAX_TURN_RATE, state, f"turning to {math.degrees(self.heading):.0f} deg"
        )
