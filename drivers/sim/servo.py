"""Output shaft of a simulated servo: it turns towards its goal at a limited speed."""

from dataclasses import dataclass

SERVO_SPEED = 400.0
"""Speed of a hobby servo in degrees per second: it takes about 0.15 s for 60 degrees."""

FRICTION_TORQUE = 0.05
"""Share of the stall torque that turns a shaft without load."""


@dataclass(slots=True)
class Shaft:
    """Output shaft with ``position`` and ``goal`` in any unit of angle, ``speed`` in that unit per second.

    ``motion_factor`` is the share of its motion that it makes: 0 if it is blocked, -1 if it turns the wrong way.
    """

    position: float
    goal: float
    speed: float
    stamp: float = 0.0
    motion_factor: float = 1.0

    def advance(self, now: float) -> float:
        """Turn the shaft until time ``now`` and return its position. Does nothing unless time has increased."""
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
        """True until the shaft reaches its goal."""
        return self.position != self.goal
