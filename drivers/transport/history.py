"""History of values, to match a picture with the pose at its time, and statistics of delays."""

from collections import deque
from collections.abc import Mapping, Sequence
from threading import Lock

# Statistics of delays, for the health of a device.


class DelayStatistics:
    """Count, sum and maximum of measured delays. One thread adds, any thread may read."""

    def __init__(self) -> None:
        self._count = 0
        self._sum = self._longest = 0.0

    def add(self, seconds: float) -> None:
        """Add one delay in seconds."""
        self._sum += seconds
        self._longest = max(self._longest, seconds)
        self._count += 1

    def counters(self, name: str) -> Mapping[str, int]:
        """Return totals for ``drivers.api.Health``, in microseconds: ``NAMEs``, ``NAME_us`` and ``longest_NAME_us``.

        The mean delay between two readings is the difference of the times divided by that of the counts.
        """
        return {
            f"{name}s": self._count,
            f"{name}_us": round(self._sum * 1e6),
            f"longest_{name}_us": round(self._longest * 1e6),
        }


class ValueHistory:
    """History of the last seconds of a few numbers, with linear interpolation. Thread-safe."""

    def __init__(self, seconds: float = 3.0) -> None:
        self._seconds = seconds
        self._entries: deque[tuple[float, tuple[float, ...]]] = deque()
        self._lock = Lock()

    def add(self, stamp: float, values: Sequence[float]) -> None:
        """Add ``values`` at ``stamp``; entries that are not older are replaced."""
        with self._lock:
            while self._entries and self._entries[-1][0] >= stamp:
                self._entries.pop()
            self._entries.append((stamp, tuple(values)))
            while self._entries[0][0] < stamp - self._seconds:
                self._entries.popleft()

    def at(self, stamp: float) -> tuple[float, ...] | None:
        """Return the values at ``stamp``: interpolated, the latest for a later time, None before the first entry."""
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
        """Return the latest entry, with its stamp; None before the first."""
        with self._lock:
            return self._entries[-1] if self._entries else None

    def clear(self) -> None:
        """Remove all entries."""
        with self._lock:
            self._entries.clear()
