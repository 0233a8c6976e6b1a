"""Differential drive with motors of limited strength: true pose, wheel travel, and faults of the sensors."""

from collections import deque
from collections.abc import Iterator
from math import cos, inf, sin
from typing import Generic, TypeVar

from drivers.api import Pose2D, Velocity

_INTEGRATION_STEP = 0.01
"""Seconds of one integration step while the speeds change; at constant speed a step of any length is exact."""


class SimulatedWheels:
    """Differential drive. All methods take the time; not thread-safe.

    ``acceleration`` in m/s^2 is that of each motor for its own wheel. ``dead_time`` in seconds passes between a command
    and its effect (users of a Kobuki measured 0.2). ``slip`` is the share 0..1 of the wheels' travel that does not move
    the base, so odometry errs as on carpet. Metres, radians and seconds throughout. Raises ValueError for values out of
    range.
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
        """True pose of the base; set it to lift the base and put it down elsewhere."""
        self.slip = slip
        self.gains = (1.0, 1.0)
        """Factors of the left and the right motor: 0 if it is not connected, -1 if it is swapped."""
        self.blocked = False
        """True while both wheels are blocked and their motors stall."""
        self.left = self.right = 0.0
        """Rim travel of each wheel, in metres, backwards negative, as its encoder measures it."""
        self.separation = separation
        self._acceleration = acceleration
        self._dead_time = dead_time
        self._speeds = self._goals = (0.0, 0.0)
        self._commands: deque[tuple[float, float, float]] = deque()
        self._now: float | None = None

    @property
    def velocity(self) -> Velocity:
        """True velocity of the base."""
        left, right = self._speeds
        grip = 1 - self.slip
        return Velocity(grip * (left + right) / 2, grip * (right - left) / self.separation)

    @property
    def speeds(self) -> tuple[float, float]:
        """Rim speeds of the left and the right wheel, in m/s."""
        return self._speeds

    @property
    def stalled(self) -> tuple[bool, bool]:
        """Whether the motor of the left and of the right wheel stalls."""
        return self.blocked and self._goals[0] != 0.0, self.blocked and self._goals[1] != 0.0

    @property
    def is_turning(self) -> bool:
        """True while a wheel turns, or a command has not taken full effect."""
        return self._speeds != (0.0, 0.0) or self._goals != (0.0, 0.0) or bool(self._commands)

    def command(self, linear: float, angular: float, now: float) -> None:
        """Command ``linear`` m/s and ``angular`` rad/s from time ``now`` on, plus the dead time."""
        self.advance(now)
        half = angular * self.separation / 2
        due = max(now, self._now or now) + self._dead_time
        self._commands.append((due, self.gains[0] * (linear - half), self.gains[1] * (linear + half)))

    def advance(self, now: float) -> Pose2D:
        """Move the base until time ``now`` and return its true pose. Does nothing unless time has increased."""
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
        """Turn both wheels for ``seconds``, and move the base along the resulting arc."""
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
    """Return the travel of a wheel whose speed changes from ``speed`` towards ``goal``, and its final speed."""
    if speed == goal:
        return goal * seconds, goal
    change = goal - speed
    needed = abs(change) / acceleration
    if needed <= seconds:
        return (speed + goal) / 2 * needed + goal * (seconds - needed), goal
    end = speed + change * seconds / needed
    return (speed + end) / 2 * seconds, end


def _sinc(angle: float) -> float:
    """Return the length of a chord as a share of its arc; the arc spans twice ``angle`` (radians)."""
    return sin(angle) / angle if angle else 1.0


# Faulty instruments of a simulated base: encoders lost or swapped, a gyro that drifts, late reports.

T = TypeVar("T")


class Encoders:
    """Encoders of two wheels, in metres. Each can be lost (it does not count), or swapped (it counts backwards)."""

    def __init__(self, wheels: SimulatedWheels) -> None:
        self._wheels = wheels
        self._signs = (1.0, 1.0)
        self._travel_before = self._wheel_reference = (0.0, 0.0)

    @property
    def is_lost(self) -> bool:
        """True if neither encoder counts."""
        return self._signs == (0.0, 0.0)

    @is_lost.setter
    def is_lost(self, lost: bool) -> None:
        self.set_signs(*(0.0, 0.0) if lost else (1.0, 1.0))

    @property
    def is_swapped(self) -> bool:
        """True if both encoders count backwards."""
        return self._signs == (-1.0, -1.0)

    @is_swapped.setter
    def is_swapped(self, swapped: bool) -> None:
        self.set_signs(*(-1.0, -1.0) if swapped else (1.0, 1.0))

    def set_signs(self, left: float, right: float) -> None:
        """Count with these signs for the left and the right wheel from now on: 1, -1, or 0 for a lost encoder."""
        self._travel_before, self._wheel_reference = self.travel, (self._wheels.left, self._wheels.right)
        self._signs = (left, right)

    @property
    def travel(self) -> tuple[float, float]:
        """Counted travel of the left and the right wheel, in metres."""
        (left, right), (left_mark, right_mark), signs = self._travel_before, self._wheel_reference, self._signs
        wheels = self._wheels
        return left + signs[0] * (wheels.left - left_mark), right + signs[1] * (wheels.right - right_mark)

    @property
    def speeds(self) -> tuple[float, float]:
        """Counted speeds of the left and the right wheel, in m/s."""
        left, right = self._wheels.speeds
        return self._signs[0] * left, self._signs[1] * right


class GyroDrift:
    """Constant error of a gyro's rate, and the accumulated error of the heading."""

    def __init__(self) -> None:
        self.rate = 0.0
        """Error of the gyro's rate in rad/s."""
        self._error = self._changed_at = 0.0

    def set_rate(self, rate: float, now: float) -> None:
        """Set the rate error (rad/s) from ``now`` on."""
        self._error, self._changed_at, self.rate = self.error(now), now, rate

    def error(self, now: float) -> float:
        """Return the heading error at time ``now``, in radians."""
        return self._error + self.rate * max(now - self._changed_at, 0.0)


class DelayLine(Generic[T]):
    """A queue that releases each item ``delay`` seconds after it was put.

    ``delay`` may be changed at any time; the items always leave in the order in which they were put.
    """

    def __init__(self) -> None:
        self.delay = 0.0
        self._queue: deque[tuple[float, T]] = deque()

    def put(self, now: float, item: T) -> None:
        """Add an item at time ``now``."""
        self._queue.append((now, item))

    def pop_due(self, now: float) -> Iterator[T]:
        """Yield and remove all items that are due at ``now``."""
        while self._queue and self._queue[0][0] <= now - self.delay + 1e-9:
            yield self._queue.popleft()[1]
