"""Leaves that drive the base: closed over its odometry, renewed at every tick."""

import math

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import BaseState, Pose2D, Velocity

BRAKING = 0.25
"""Deceleration in m/s^2 that the approach to the goal counts on: half of what the base is limited to."""

TURN_BRAKING = 1.2
"""The same in rad/s^2."""

CRAWL = 0.02
"""Speed in m/s of the last bit: what the base still rolls after it was told to stop is then a few millimetres."""

TURN_CRAWL = math.radians(4)
"""The same in rad/s."""

REACTION = 0.25
"""Seconds from a report to the motion that answers it: the Kobuki's dead time (users measured 0.2 s) and a tick."""

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
        """Return the base's newest report, None while there is no fresh one; the first one is where it starts."""
        reading = self.robot.base.state()
        if not reading.good or reading.value is None:
            return None
        if self._start is None:
            self._start = reading.value.pose
        return reading.value

    def come_to_rest(self, speed: float) -> Status:
        """Stop, and succeed once it stands still."""
        if not self._stopping:
            self._stopping = True
            self.robot.base.stop()
        return SUCCESS if abs(speed) < STANDSTILL else self.wait("stopping")

    def approach(self, left: float, *, braking: float, crawl: float) -> float:
        """Return how fast to go with ``left`` (m or rad) to go; 0 when it is time to stop.

        A motion that ends at the goal with an even deceleration b has v^2 / 2b left. A command that acts a time T
        after its report meets v + b T at that report, hence (v + b T)^2 / 2b. How long T really is, matters little: the
        last bit is done at a crawl, and half of what that covers in T is where to stop.
        """
        if self._stopping or left <= crawl * REACTION / 2:
            return 0.0
        return max(crawl, math.sqrt(2 * braking * left) - braking * REACTION)

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
        trouble = obstacle(state, forward=direction > 0)
        if trouble:
            return self.fail(trouble)
        gone = _along(self._start, state.pose)
        speed = self.approach((self.distance - gone) * direction, braking=BRAKING, crawl=CRAWL)
        if speed == 0.0:
            return self.come_to_rest(state.velocity.linear)
        # Hold the line: a heading error of 1 degree is turned back within about a second.
        steer = 2.0 * (self._start.heading - state.pose.heading)
        self.robot.base.drive(Velocity(direction * min(speed, self.speed), max(-0.5, min(0.5, steer))))
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
        trouble = obstacle(state, forward=False)
        if trouble:
            return self.fail(trouble)
        direction = math.copysign(1.0, self.angle)
        turned = state.pose.heading - self._start.heading
        rate = self.approach((self.angle - turned) * direction, braking=TURN_BRAKING, crawl=TURN_CRAWL)
        if rate == 0.0:
            return self.come_to_rest(state.velocity.angular)
        self.robot.base.drive(Velocity(0.0, direction * min(rate, self.speed)))
        return self.wait(f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg")


class Arc(_Motion):
    """Drive forwards along a part of a circle: to the left for a positive angle, to the right for a negative one.

    Running until the base has turned by the angle, by the gyro, and stands still, then succeeds.
    Fails when it bumps into something, comes to a cliff, or a wheel drops.
    """

    word = "arc"
    radius: float = argument("length", "of the circle", low=0.05, high=10.0)
    angle: float = argument("angle", "how far round; positive is to the left", default=math.tau)
    speed: float = argument("speed", "how fast along the circle", default=0.2, low=0.01, high=0.7)

    def update(self) -> Status:
        state = self.state()
        if state is None or self._start is None:
            return self.wait("waiting for the base to report")
        trouble = obstacle(state, forward=True)
        if trouble:
            return self.fail(trouble)
        direction = math.copysign(1.0, self.angle)
        turned = state.pose.heading - self._start.heading
        # Whichever of driving and turning needs more care on this circle says how fast it may go round.
        rate = self.approach(
            (self.angle - turned) * direction,
            braking=min(TURN_BRAKING, BRAKING / self.radius),
            crawl=min(TURN_CRAWL, CRAWL / self.radius),
        )
        if rate == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        rate = min(rate, self.speed / self.radius)
        self.robot.base.drive(Velocity(rate * self.radius, direction * rate))
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
        # What it was told a moment before may still be on its way to the wheels.
        return SUCCESS if moving < STANDSTILL and self.elapsed >= REACTION else self.wait("stopping")


def obstacle(state: BaseState, *, forward: bool) -> str:
    """Say what stops a base from going on, or nothing; what is ahead matters only where it goes ``forward``."""
    if state.wheel_drop:
        return "a wheel has dropped"
    if forward and state.cliff:
        return "a cliff ahead"
    if forward and state.bumper:
        return "bumped into something"
    return ""


def _along(start: Pose2D, now: Pose2D) -> float:
    """Return how far ``now`` lies ahead of ``start`` along its heading, in metres."""
    return (now.x - start.x) * math.cos(start.heading) + (now.y - start.y) * math.sin(start.heading)
