"""How often a picture may be kept, so that a record stays within its limit however long the run is."""

DEFAULT_MAX_BYTES = 2_000_000_000
"""Bytes of a record, unless somebody says otherwise."""

DEFAULT_FRAME_RATE = 5.0
"""Pictures a second, unless somebody says otherwise."""


class FrameBudget:
    """Says which frames are due: at most ``rate`` a second, of ``most`` bytes in all.

    Each time half of what was left is used up, the rate is halved: there are always some pictures, and the first
    minutes have the most. A rate of 0 is none at all.
    """

    def __init__(self, max_bytes: float, rate: float) -> None:
        self.rate = rate
        self._bytes_left = max_bytes
        self._bytes_to_halving = max_bytes / 2  # what may still be used before the rate is halved
        self._next_frame_at = float("-inf")

    def accept(self, t: float) -> bool:
        """Say whether a frame of ``t`` seconds is to be kept; then it counts as the newest."""
        if self.rate <= 0 or t < self._next_frame_at:
            return False
        # On a steady beat the rate is met on the average, though frames come at times of their own.
        beat = 1 / self.rate
        self._next_frame_at = max(self._next_frame_at + beat, t + beat / 2)
        return True

    def consume(self, size: int) -> None:
        """Note that a frame took ``size`` bytes."""
        self._bytes_left -= size
        self._bytes_to_halving -= size
        while self._bytes_to_halving <= 0 < self.rate:
            if self._bytes_left <= 0:
                self.rate = 0.0
                return
            self.rate /= 2
            self._bytes_to_halving = self._bytes_left / 2
