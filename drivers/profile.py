"""How a commanded angle gets to its goal: the motion profile of drivers whose servos know none of their own."""

from dataclasses import dataclass, field

LONGEST_STEP = 0.1
"""Seconds that one step covers at most: a thread that was held up must not turn into a jump."""


@dataclass(slots=True)
class Ramp:
    """Goes to its goal at no more than ``speed`` (rad/s). ``position`` in radians; it starts at rest."""

    position: float
    speed: float
    goal: float = field(init=False)
    stamp: float = 0.0

    def __post_init__(self) -> None:
        self.goal = self.position

    def aim(self, goal: float, now: float) -> None:
        """Start for ``goal`` at time ``now``, from where it has got to."""
        self.advance(now)
        self.goal = goal

    def advance(self, now: float) -> float:
        """Move on until time ``now`` and return the position. Time that does not rise changes nothing."""
        elapsed = min(max(0.0, now - self.stamp), LONGEST_STEP)
        self.stamp = max(self.stamp, now)
        reach = self.speed * elapsed
        self.position += min(max(self.goal - self.position, -reach), reach)
        return self.position

    def place(self, position: float, now: float) -> None:
        """Go on from ``position`` (radians), where it turned out to stand at time ``now``; the goal stays."""
        self.position, self.stamp = position, now

    def halt(self) -> None:
        """Make the present position the goal."""
        self.goal = self.position
