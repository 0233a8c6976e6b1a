"""How a commanded angle gets to its goal: the motion profile of drivers whose servos know none of their own."""

from dataclasses import field
from math import copysign, sqrt

from drivers.api.quick import dataclass

LONGEST_STEP = 0.1
"""Seconds that one step covers at most: a thread that was held up must not turn into a jump."""


@dataclass(slots=True)
class Profile:
    """Goes to its goal in the shortest time that ``speed`` (rad/s) and ``acceleration`` (rad/s^2) allow.

    That is the trapezoidal profile: speed up, go on, brake. Its phases are worked out exactly for whatever time has
    passed, so it does not matter how often it is asked; a new goal is taken up in full motion, without a jerk of the
    angle. ``position`` in radians, ``velocity`` in rad/s; it starts at rest. ``braked`` is which way it went (1 or -1)
    when it was told to brake, and 0 once it has a goal.
    """

    position: float
    speed: float
    acceleration: float
    velocity: float = 0.0
    goal: float = field(init=False)
    stamp: float = 0.0
    braked: float = 0.0

    def __post_init__(self) -> None:
        self.goal = self.position

    def aim(self, goal: float, now: float) -> None:
        """Start for ``goal`` at time ``now``, from where it has got to."""
        self.advance(now)
        self.goal, self.braked = goal, 0.0

    def brake(self, now: float) -> None:
        """Come to rest as soon as the acceleration allows, from time ``now`` on."""
        self.advance(now)
        way = self.velocity or self.goal - self.position
        self.goal, self.braked = self._standstill(), copysign(1.0, way) if way else self.braked

    def advance(self, now: float) -> float:
        """Move on until time ``now`` and return the position. Time that does not rise changes nothing."""
        left = now - self.stamp
        if left <= 0.0:
            return self.position
        self.stamp = now
        if self.position == self.goal and self.velocity == 0.0:
            return self.position
        left = min(left, LONGEST_STEP)
        for seconds, acceleration in self._phases():
            step = min(seconds, left)
            self.position += (self.velocity + acceleration * step / 2) * step
            self.velocity += acceleration * step
            left -= step
            if step < seconds:
                return self.position
        self.position, self.velocity = self.goal, 0.0
        return self.position

    @property
    def heading(self) -> float:
        """Where it is going now: to its goal, or, while it still goes the other way, to where it will have braked."""
        standstill = self._standstill()
        return standstill if (self.goal - standstill) * self.velocity < 0 else self.goal

    def place(self, position: float, now: float) -> None:
        """Go on from ``position`` (radians), where it turned out to stand at time ``now``; the goal stays."""
        self.position, self.velocity, self.stamp, self.braked = position, 0.0, now, 0.0

    def shift(self, angle: float) -> None:
        """Call the present position by another number, ``angle`` (radians) greater; the goal's number stays."""
        self.position += angle

    def halt(self) -> None:
        """Stand still at the present position at once."""
        self.goal, self.velocity = self.position, 0.0

    def _standstill(self) -> float:
        """Where it would come to rest if it braked now."""
        return self.position + self.velocity * abs(self.velocity) / (2 * self.acceleration)

    def _phases(self) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
        """Return the three phases from here to rest at the goal: how many seconds, with which acceleration (rad/s^2).

        Worked out as if the goal lay ahead: where it would overshoot, ahead is back. ``peak`` is the speed reached.
        """
        ahead = copysign(1.0, self.goal - self._standstill())
        way, begin = ahead * (self.goal - self.position), ahead * self.velocity
        peak = min(self.speed, sqrt(max(0.0, self.acceleration * way + begin**2 / 2)))
        gain, loss = (peak - begin) / self.acceleration, peak / self.acceleration
        even = way - (peak + begin) / 2 * abs(gain) - peak / 2 * loss  # it may be faster than it may go by now
        return (
            (abs(gain), copysign(self.acceleration, ahead * gain)),
            (max(0.0, even / peak) if peak > 0 else 0.0, 0.0),
            (loss, -ahead * self.acceleration),
        )
