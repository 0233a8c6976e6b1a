"""Leaves that drive the base: closed over its odometry, renewed at every tick."""

import math

from py_trees.common import Status

from behaviours.leaf import RUNNING, SUCCESS, Leaf, argument
from drivers.api import BaseState, Pose2D, Velocity

BRAKING = 0.25
"""Deceleration in m/s^2 that the approach to the goal counts on: half of what the base is limited to."""

TURN_BRAKING = 1.2
"""The same in rad/s^2."""

LATENCY = 0.15
"""Seconds from a command to the motion, as the Kobuki shows them (users measured about 0.2 s on the metal)."""

STANDSTILL = 0.01
"""Below this speed (m/s or rad/s) it has stopped."""


class _Motion(Leaf):
    """What driving and turning have in common: a start pose, and a stop unless it succeeded."""

    needs = frozenset({"base"})
    drives = frozenset({"base"})
    _start: Pose2D | None = None
    _stopping = False

    def initialise(self) -> None:
        self._start, self._stopping = None, False

    def state(self) -> BaseState | None:
        """Return the base's newest report, None while there is no fresh one; the first one sets the start."""
        reading = self.robot.base.state()
        if not reading.good or reading.value is None:
            return None
        if self._start is None:
            self._start = reading.value.pose
        return reading.value

    def obstacle(self, state: BaseState, forward: bool) -> str:
        """Say what stops the base from going on, or nothing."""
        if state.wheel_drop:
            return "a wheel has dropped"
        if forward and state.cliff:
            return "a cliff ahead"
        if forward and state.bumper:
            return "bumped into something"
        return ""

    def come_to_rest(self, speed: float) -> Status:
        """Stop, and succeed once it stands still."""
        if not self._stopping:
            self._stopping = True
            self.robot.base.stop()
        return SUCCESS if abs(speed) < STANDSTILL else self.wait("stopping")

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.base.stop()


class Drive(_Motion):
    """Drive straight ahead, or back for a negative distance.

    Running until the distance is covered by odometry and the base stands still, then succeeds.
    Fails when it bumps into something, comes to a cliff, or a wheel drops.
    """

    word = "drive"
    distance: float = argument("length", "how far; negative is backwards", principal=True)
    speed: float = argument("speed", "how fast", default=0.2, low=0.01, high=0.7)

    def update(self) -> Status:
        state = self.state()
        if state is None or self._start is None:
            return self.wait("waiting for the base to report")
        direction = math.copysign(1.0, self.distance)
        trouble = self.obstacle(state, forward=direction > 0)
        if trouble:
            return self.fail(trouble)
        gone = _along(self._start, state.pose)
        left = (self.distance - gone) * direction
        ahead = left - abs(state.velocity.linear) * LATENCY
        if self._stopping or ahead <= 0.002:
            return self.come_to_rest(state.velocity.linear)
        speed = min(self.speed, max(0.02, math.sqrt(2 * BRAKING * ahead)))
        # Hold the line: a heading error of 1 degree is turned back within about a second.
        steer = -2.0 * (state.pose.heading - self._start.heading)
        self.robot.base.drive(Velocity(direction * speed, max(-0.5, min(0.5, steer))))
        return self.wait(f"{gone:.2f} of {self.distance:.2f} m")


class Turn(_Motion):
    """Turn on the spot: to the left for a positive angle, to the right for a negative one.

    Running until the angle is reached by the gyro and the base stands still, then succeeds.
    Fails when a wheel drops.
    """

    word = "turn"
    angle: float = argument("angle", "how far; positive is to the left", principal=True)
    speed: float = argument("turn rate", "how fast", default=math.radians(60), low=math.radians(1), high=math.pi)

    def update(self) -> Status:
        state = self.state()
        if state is None or self._start is None:
            return self.wait("waiting for the base to report")
        trouble = self.obstacle(state, forward=False)
        if trouble:
            return self.fail(trouble)
        direction = math.copysign(1.0, self.angle)
        turned = state.pose.heading - self._start.heading
        ahead = (self.angle - turned) * direction - abs(state.velocity.angular) * LATENCY
        if self._stopping or ahead <= math.radians(0.2):
            return self.come_to_rest(state.velocity.angular)
        rate = min(self.speed, max(math.radians(4), math.sqrt(2 * TURN_BRAKING * ahead)))
        self.robot.base.drive(Velocity(0.0, direction * rate))
        return self.wait(f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg")


class Stop(_Motion):
    """Stop the base.

    Running until it stands still, then succeeds.
    """

    word = "stop"

    def initialise(self) -> None:
        super().initialise()
        self.robot.base.stop()

    def update(self) -> Status:
        state = self.state()
        if state is None:
            return self.wait("waiting for the base to report")
        moving = max(abs(state.velocity.linear), abs(state.velocity.angular))
        return SUCCESS if moving < STANDSTILL else RUNNING


def _along(start: Pose2D, now: Pose2D) -> float:
    """Return how far ``now`` lies ahead of ``start`` along its heading, in metres."""
    return (now.x - start.x) * math.cos(start.heading) + (now.y - start.y) * math.sin(start.heading)
