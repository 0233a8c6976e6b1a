"""History of values, to look up the pose of the camera at the time of a picture; and statistics of delays."""

from collections import deque
from collections.abc import Mapping, Sequence
from threading import Lock

# Statistics of delays, for the health of a device.


class DelayStatistics:
    """Number, sum and maximum of measured delays. One thread adds delays, any thread may read them."""

    def __init__(self) -> None:
        self._count = 0
        self._sum = self._longest = 0.0

    def add(self, seconds: float) -> None:
        """Add one delay in seconds."""
        self._sum += seconds
        self._longest = max(self._longest, seconds)
        self._count += 1

    def counters(self, name: str) -> Mapping[str, int]:
        """Return the statistics as counters for ``drivers.api.Health``.

        They are the number of delays ``NAMEs``, and in microseconds the sum ``NAME_us`` and the maximum
        ``longest_NAME_us``. The mean delay between two readings is the difference of the sums divided by the difference
        of the numbers.
        """
        return {
            f"{name}s": self._count,
            f"{name}_us": round(self._sum * 1e6),
            f"longest_{name}_us": round(self._longest * 1e6),
        }


class ValueHistory:
    """History of a tuple of numbers over the last ``seconds``, with linear interpolation. Thread-safe."""

    def __init__(self, seconds: float = 3.0) -> None:
        self._seconds = seconds
        self._entries: deque[tuple[float, tuple[float, ...]]] = deque()
        self._lock = Lock()

    def add(self, stamp: float, values: Sequence[float]) -> None:
        """Add ``values`` at the time ``stamp``. Values with the same or a later stamp are removed."""
        with self._lock:
            while self._entries and self._entries[-1][0] >= stamp:
                self._entries.pop()
            self._entries.append((stamp, tuple(values)))
            while self._entries[0][0] < stamp - self._seconds:
                self._entries.popleft()

    def at(self, stamp: float) -> tuple[float, ...] | None:
        """Return the values at the time ``stamp``, interpolated; the latest ones if it is later; None if too early."""
        with self._lock:
            later: tuple[float, tuple[float, ...]] | None = None
            for entry in reversed(self._entries):
                if entry[0] <= stamp:
                    if later is None:
                        return entry[1]
                    share = (stamp - entry[0]) / (later[0] - entry[0])
                    return tuple(a + share * (b - a) for a, b in zip(entry[1], later[1], strict=True))
                later = entry
            return None

    def newest(self) -> tuple[float, tuple[float, ...]] | None:
        """Return the latest stamp and values; None if the history is empty."""
        with self._lock:
            return self._entries[-1] if self._entries else None

    def clear(self) -> None:
        """Remove all values."""
        with self._lock:
            self._entries.clear()
