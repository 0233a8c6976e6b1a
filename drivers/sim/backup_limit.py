"""The backup limit of a Create 3, which has no cliff sensors at its back: it backs only over floor that it has seen."""

ALLOWANCE = 0.12
"""Metres that it backs before it has driven forwards: 10 cm and braking, as a user of a TurtleBot 4 reports."""

RELEASE = 0.05
"""Metres that it has to drive forwards before it backs again. The vendor says "for a while": an assumption."""


class BackupLimit:
    """Backs ``allowance`` metres (one of at least 0), and no farther than it has driven forwards since.

    ``reached`` is True from when the base refuses to back until it has driven ``RELEASE`` forwards.
    """

    def __init__(self, allowance: float = ALLOWANCE) -> None:
        self.reached = False
        self._left = allowance

    def roll(self, way: float) -> None:
        """Take in how far the wheels have rolled since the last call, in metres, backwards negative."""
        self._left = max(self._left + way, 0.0)
        if self._left <= 0.0 and way < 0.0:
            self.reached = True
        elif self._left >= RELEASE:
            self.reached = False

    def lift(self) -> None:
        """Take in that the base hangs in the air: that reaches the limit."""
        self._left, self.reached = 0.0, True
