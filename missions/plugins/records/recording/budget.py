"""Frame rate control that keeps a record within its size limit, however long the run."""

DEFAULT_MAX_BYTES = 2_000_000_000
"""Default maximum size of a record, in bytes."""

DEFAULT_FRAME_RATE = 5.0
"""Default number of pictures per second in a record."""


class FrameBudget:
    """Frame rate limiter: at most ``rate`` frames a second, of ``max_bytes`` bytes in all.

    The rate is halved each time half of the remaining bytes is used up. So the whole run has some pictures, and the
    first minutes have the most. A rate of 0 accepts none.
    """

    def __init__(self, max_bytes: float, rate: float) -> None:
        self.rate = rate
        self._bytes_left = max_bytes
        self._bytes_to_halving = max_bytes / 2
        self._next_frame_at = float("-inf")

    def accept(self, t: float) -> bool:
        """Return whether to record the frame of time ``t`` (s); an accepted frame delays the next one."""
        if self.rate <= 0 or t < self._next_frame_at:
            return False
        # A fixed time grid keeps the average rate although frames arrive at irregular times.
        beat = 1 / self.rate
        self._next_frame_at = max(self._next_frame_at + beat, t + beat / 2)
        return True

    def consume(self, size: int) -> None:
        """Subtract the ``size`` (bytes) of a recorded frame."""
        self._bytes_left -= size
        self._bytes_to_halving -= size
        while self._bytes_to_halving <= 0 < self.rate:
            if self._bytes_left <= 0:
                self.rate = 0.0
                return
            self.rate /= 2
            self._bytes_to_halving = self._bytes_left / 2
