"""A servo's shaft: it turns towards its goal at no more than its speed."""

from dataclasses import dataclass

SERVO_SPEED = 400.0
"""Degrees per second: a hobby servo needs about 0.15 s for 60 degrees."""

FRICTION_TORQUE = 0.05
"""Share of the stall torque that it takes to turn an unburdened shaft."""


@dataclass(slots=True)
class Shaft:
    """One output shaft. ``position`` and ``goal`` in any one unit of angle, ``speed`` in that unit per second.

    ``motion_factor`` is the share of its way that it makes: 0 while it is blocked, -1 for one that turns the wrong way.
    """

    position: float
    goal: float
    speed: float
    stamp: float = 0.0
    motion_factor: float = 1.0

    def advance(self, now: float) -> float:
        """Turn until time ``now`` and return the position. Time that does not rise changes nothing."""
        elapsed = max(0.0, now - self.stamp)
        self.stamp = max(self.stamp, now)
        reach = self.speed * elapsed
        if self.motion_factor == 1.0 and abs(self.goal - self.position) <= reach:
            self.position = self.goal  # exactly: a sum may miss it by a rounding error, again and again
        else:
            self.position += self.motion_factor * min(max(self.goal - self.position, -reach), reach)
        return self.position

    @property
    def is_moving(self) -> bool:
        """True while it has not arrived."""
        return self.position != self.goal
