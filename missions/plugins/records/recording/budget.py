"""How often a picture may be kept, so that a record stays within its limit however long the run is."""

LIMIT = 2_000_000_000
"""Bytes of a record, unless somebody says otherwise."""

FRAMES = 5.0
"""Pictures a second, unless somebody says otherwise."""


class FrameBudget:
    """Says which frames are due: at most ``rate`` a second, of ``most`` bytes in all.

    Each time half of what was left is used up, the rate is halved: there are always some pictures, and the first
    minutes have the most. A rate of 0 is none at all.
    """

    def __init__(self, most: float, rate: float) -> None:
        self.rate = rate
        self._left = most
        self._stretch = most / 2  # what may still be used before the rate is halved
        self._next = float("-inf")

    def due(self, t: float) -> bool:
        """Say whether a frame of ``t`` seconds is to be kept; then it counts as the newest."""
        if self.rate <= 0 or t < self._next:
            return False
        # On a steady beat the rate is met on the average, though frames come at times of their own.
        beat = 1 / self.rate
        self._next = max(self._next + beat, t + beat / 2)
        return True

    def used(self, size: int) -> None:
        """Note that a frame took ``size`` bytes."""
        self._left -= size
        self._stretch -= size
        while self._stretch <= 0 < self.rate:
            if self._left <= 0:
                self.rate = 0.0
                return
            self.rate /= 2
            self._stretch = self._left / 2
