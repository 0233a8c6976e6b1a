"""The time limit of a motion: the time that it can take plus a margin, on a clock that slows while it is held up."""

from math import isfinite

from drivers.api import BaseLimits, Steering, Velocity

MARGIN_SHARE, MARGIN = 1.5, 5.0
"""A motion may take so many times as long as it can take, and so many seconds more."""

LONGEST_TICK = 1.0
"""Seconds between two ticks that count at most: a run that is paused is not ticked, so a pause counts as one second."""

NO_PROGRESS_LIMIT = 30.0
"""Seconds for which a motion that a node of ROS 2 does may stand still. Nav2 gives up after 10 s by itself."""

UNHINDERED = ("", "limited")
"""Reasons for which a base goes slower than wanted that do not stop the clock."""


def seconds_for(way: float, speed: float, limit: float, acceleration: float) -> float:
    """Return how long a way (m or rad) takes from rest to rest: two ramps, and braking that is half as hard."""
    fastest = max(min(abs(speed), limit), 1e-6)
    return abs(way) / fastest + 3 * fastest / acceleration


def seconds_to_drive(way: float, speed: float, limits: BaseLimits) -> float:
    """Return how long it takes to drive a way in metres."""
    return seconds_for(way, speed, limits.speed, limits.acceleration)


def seconds_to_turn(angle: float, speed: float, limits: BaseLimits) -> float:
    """Return how long it takes to turn by an angle in radians."""
    return seconds_for(angle, speed, limits.turn, limits.turn_acceleration)


class MotionClock:
    """Counts the seconds in which a motion could go on."""

    def __init__(self) -> None:
        self.spent = 0.0
        self._at: float | None = None

    def restart(self) -> None:
        """Begin at 0."""
        self.spent, self._at = 0.0, None

    def stop(self) -> None:
        """Stand still until the next ``run``: a person has the wheels, or nothing is known of the base."""
        self._at = None

    def grant(self, seconds: float) -> None:
        """Give so many seconds more, for work that the limit does not know of."""
        self.spent -= seconds

    def scale(self, before: float, limit: float) -> None:
        """Keep the share that is spent of a limit when it changes from ``before`` to ``limit`` seconds."""
        if isfinite(before) and isfinite(limit):
            self.spent *= limit / before

    def run(self, now: float, steering: Steering) -> float:
        """Go on until ``now``, as fast as the base may of what is wanted; return the seconds spent."""
        if self._at is not None:
            self.spent += min(now - self._at, LONGEST_TICK) * _share(steering)
        self._at = now
        return self.spent


def limit_of(seconds: float) -> float:
    """Return the time limit of a motion that can be done in so many seconds."""
    return MARGIN_SHARE * seconds + MARGIN


def _share(steering: Steering) -> float:
    """Return which share of what is wanted the base may do: less where something holds it up, such as an obstacle."""
    if steering.because in UNHINDERED or steering.fault:
        return 1.0
    wanted, given = _size(steering.wanted), _size(steering.given)
    return 1.0 if wanted == 0.0 else min(1.0, given / wanted)


def _size(velocity: Velocity) -> float:
    return abs(velocity.linear) or abs(velocity.angular)
