"""Two driven wheels on one axle, with motors of limited strength: where a base really is, what its wheels turned."""

from collections import deque
from collections.abc import Iterator
from math import cos, inf, sin
from typing import Generic, TypeVar

from drivers.api import Pose2D, Velocity

_INTEGRATION_STEP = 0.01
"""Seconds of one step of integration while the speeds change; at constant speed a step is exact however long."""


class SimulatedWheels:
    """A differential drive whose time is handed in. Not safe between threads.

    ``acceleration`` in m/s^2 is what each motor does to its own wheel; ``dead_time`` in seconds passes between a
    command and its effect (users of a Kobuki measured 0.2); ``slip`` is the share 0..1 of the wheels' travel that
    does not move the base, so that odometry errs as it does on carpet. Metres, radians and seconds throughout.
    Raises ValueError for values that make no sense.
    """

    def __init__(
        self,
        *,
        separation: float = 0.23,
        acceleration: float = 2.0,
        dead_time: float = 0.0,
        slip: float = 0.0,
        pose: Pose2D | None = None,
    ) -> None:
        if not (separation > 0 and acceleration > 0 and dead_time >= 0 and 0 <= slip < 1):
            raise ValueError(f"wheels: {separation=}, {acceleration=}, {dead_time=}, {slip=}: out of range")
        self.pose = pose or Pose2D(0.0, 0.0, 0.0)
        """The true pose; set it to lift the base and put it down elsewhere."""
        self.slip = slip
        self.gains = (1.0, 1.0)
        """What the left and the right motor make of a command: 0 if it is not connected, -1 if it is swapped."""
        self.blocked = False
        """True while both wheels are held fast: their motors push in vain."""
        self.left = self.right = 0.0
        """How far the rim of each wheel has turned, in metres, backwards negative: what its encoder counts."""
        self.separation = separation
        self._acceleration = acceleration
        self._dead_time = dead_time
        self._speeds = self._goals = (0.0, 0.0)
        self._commands: deque[tuple[float, float, float]] = deque()
        self._now: float | None = None

    @property
    def velocity(self) -> Velocity:
        """How fast the base really moves."""
        left, right = self._speeds
        grip = 1 - self.slip
        return Velocity(grip * (left + right) / 2, grip * (right - left) / self.separation)

    @property
    def speeds(self) -> tuple[float, float]:
        """How fast the rims of the left and the right wheel turn, in m/s."""
        return self._speeds

    @property
    def stalled(self) -> tuple[bool, bool]:
        """Whether the motors of the left and the right wheel push in vain."""
        return self.blocked and self._goals[0] != 0.0, self.blocked and self._goals[1] != 0.0

    @property
    def is_turning(self) -> bool:
        """True while a wheel turns, or a command waits that may make it turn."""
        return self._speeds != (0.0, 0.0) or self._goals != (0.0, 0.0) or bool(self._commands)

    def command(self, linear: float, angular: float, now: float) -> None:
        """Ask the motors for ``linear`` m/s and ``angular`` rad/s from time ``now``, or a dead time later."""
        self.advance(now)
        half = angular * self.separation / 2
        due = max(now, self._now or now) + self._dead_time
        self._commands.append((due, self.gains[0] * (linear - half), self.gains[1] * (linear + half)))

    def advance(self, now: float) -> Pose2D:
        """Roll on until time ``now`` and return the true pose. Time that does not rise changes nothing."""
        if self._now is None:
            self._now = now
        while self._now < now or self._is_due(self._now):
            if self._is_due(self._now):
                _, *goals = self._commands.popleft()
                self._goals = (goals[0], goals[1])
                continue
            until = min(now, self._commands[0][0] if self._commands else inf)
            if self._speeds != self._goals:
                until = min(until, self._now + _INTEGRATION_STEP)
            self._roll(until - self._now)
            self._now = until
        return self.pose

    def _is_due(self, now: float) -> bool:
        return bool(self._commands) and self._commands[0][0] <= now

    def _roll(self, seconds: float) -> None:
        """Turn both wheels for ``delay``, and move the base along the arc that this makes."""
        if self.blocked:
            self._speeds = (0.0, 0.0)
        if self.blocked or self._speeds == self._goals == (0.0, 0.0):
            return
        left, left_speed = _accelerate(self._speeds[0], self._goals[0], self._acceleration, seconds)
        right, right_speed = _accelerate(self._speeds[1], self._goals[1], self._acceleration, seconds)
        self._speeds = (left_speed, right_speed)
        self.left += left
        self.right += right
        grip = 1 - self.slip
        turn = grip * (right - left) / self.separation
        chord = grip * (left + right) / 2 * _sinc(turn / 2)
        along = self.pose.heading + turn / 2
        self.pose = Pose2D(self.pose.x + chord * cos(along), self.pose.y + chord * sin(along), self.pose.heading + turn)


def _accelerate(speed: float, goal: float, acceleration: float, seconds: float) -> tuple[float, float]:
    """Return the travel of a wheel that changes from ``speed`` towards ``goal``, and its speed at the end."""
    if speed == goal:
        return goal * seconds, goal
    change = goal - speed
    needed = abs(change) / acceleration
    if needed <= seconds:
        return (speed + goal) / 2 * needed + goal * (seconds - needed), goal
    end = speed + change * seconds / needed
    return (speed + end) / 2 * seconds, end


def _sinc(angle: float) -> float:
    """Return how much shorter a chord is than its arc of twice ``angle``."""
    return sin(angle) / angle if angle else 1.0


# Faulty instruments of a simulated base: encoders lost or swapped, a gyro that drifts, late reports.

T = TypeVar("T")


class Encoders:
    """Counts how far two wheels turn, in metres; ``is_lost``, both stand still, ``is_swapped``, both count the other way."""

    def __init__(self, wheels: SimulatedWheels) -> None:
        self._wheels = wheels
        self._signs = (1.0, 1.0)
        self._travel_before = self._wheel_reference = (0.0, 0.0)

    @property
    def is_lost(self) -> bool:
        """Whether neither counts."""
        return self._signs == (0.0, 0.0)

    @is_lost.setter
    def is_lost(self, lost: bool) -> None:
        self.set_signs(*(0.0, 0.0) if lost else (1.0, 1.0))

    @property
    def is_swapped(self) -> bool:
        """Whether both count the other way."""
        return self._signs == (-1.0, -1.0)

    @is_swapped.setter
    def is_swapped(self, swapped: bool) -> None:
        self.set_signs(*(-1.0, -1.0) if swapped else (1.0, 1.0))

    def set_signs(self, left: float, right: float) -> None:
        """Count so many metres for each that the left and the right wheel turn from now on."""
        self._travel_before, self._wheel_reference = self.travel, (self._wheels.left, self._wheels.right)
        self._signs = (left, right)

    @property
    def travel(self) -> tuple[float, float]:
        """How far the left and the right wheel have turned, as far as was counted."""
        (left, right), (left_mark, right_mark), signs = self._travel_before, self._wheel_reference, self._signs
        wheels = self._wheels
        return left + signs[0] * (wheels.left - left_mark), right + signs[1] * (wheels.right - right_mark)

    @property
    def speeds(self) -> tuple[float, float]:
        """How fast both wheels turn, as far as that is counted, in m/s."""
        left, right = self._wheels.speeds
        return self._signs[0] * left, self._signs[1] * right


class GyroDrift:
    """A constant error of a gyro's rate, and the heading that it has added up to."""

    def __init__(self) -> None:
        self.rate = 0.0
        """rad/s"""
        self._error = self._changed_at = 0.0

    def set_rate(self, rate: float, now: float) -> None:
        """Err by ``rate`` from ``now`` on."""
        self._error, self._changed_at, self.rate = self.error(now), now, rate

    def error(self, now: float) -> float:
        """Return the error of the heading at time ``now``, in radians."""
        return self._error + self.rate * max(now - self._changed_at, 0.0)


class DelayLine(Generic[T]):
    """Hands things on ``delay`` after they came; the delay may change at any time, and nothing overtakes."""

    def __init__(self) -> None:
        self.delay = 0.0
        self._queue: deque[tuple[float, T]] = deque()

    def put(self, now: float, item: T) -> None:
        """Take something at time ``now``."""
        self._queue.append((now, item))

    def pop_due(self, now: float) -> Iterator[T]:
        """Yield all that is due by ``now``."""
        while self._queue and self._queue[0][0] <= now - self.delay + 1e-9:
            yield self._queue.popleft()[1]
