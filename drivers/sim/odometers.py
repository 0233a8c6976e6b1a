"""Faulty instruments of a simulated base: encoders lost or swapped, a gyro that drifts, late reports."""

from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

from drivers.sim.wheels import Wheels

T = TypeVar("T")


class Encoders:
    """Counts how far two wheels turn, in metres; ``lost``, both stand still, ``swapped``, both count the other way."""

    def __init__(self, wheels: Wheels) -> None:
        self._wheels = wheels
        self._signs = (1.0, 1.0)
        self._counted = self._mark = (0.0, 0.0)

    @property
    def lost(self) -> bool:
        """Whether neither counts."""
        return self._signs == (0.0, 0.0)

    @lost.setter
    def lost(self, lost: bool) -> None:
        self.count(*(0.0, 0.0) if lost else (1.0, 1.0))

    @property
    def swapped(self) -> bool:
        """Whether both count the other way."""
        return self._signs == (-1.0, -1.0)

    @swapped.setter
    def swapped(self, swapped: bool) -> None:
        self.count(*(-1.0, -1.0) if swapped else (1.0, 1.0))

    def count(self, left: float, right: float) -> None:
        """Count so many metres for each that the left and the right wheel turn from now on."""
        self._counted, self._mark = self.travel, (self._wheels.left, self._wheels.right)
        self._signs = (left, right)

    @property
    def travel(self) -> tuple[float, float]:
        """How far the left and the right wheel have turned, as far as was counted."""
        (left, right), (left_mark, right_mark), signs = self._counted, self._mark, self._signs
        wheels = self._wheels
        return left + signs[0] * (wheels.left - left_mark), right + signs[1] * (wheels.right - right_mark)

    @property
    def speeds(self) -> tuple[float, float]:
        """How fast both wheels turn, as far as that is counted, in m/s."""
        left, right = self._wheels.speeds
        return self._signs[0] * left, self._signs[1] * right


class GyroDrift:
    """A constant error of a gyro's rate, and the heading that it has added up to."""

    def __init__(self) -> None:
        self.rate = 0.0
        """rad/s"""
        self._error = self._at = 0.0

    def drift(self, rate: float, now: float) -> None:
        """Err by ``rate`` from ``now`` on."""
        self._error, self._at, self.rate = self.error(now), now, rate

    def error(self, now: float) -> float:
        """Return the error of the heading at time ``now``, in radians."""
        return self._error + self.rate * max(now - self._at, 0.0)


class DelayLine(Generic[T]):
    """Hands things on ``seconds`` after they came; the delay may change at any time, and nothing overtakes."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._under_way: deque[tuple[float, T]] = deque()

    def put(self, now: float, thing: T) -> None:
        """Take something at time ``now``."""
        self._under_way.append((now, thing))

    def due(self, now: float) -> Iterator[T]:
        """Yield all that is due by ``now``."""
        while self._under_way and self._under_way[0][0] <= now - self.seconds + 1e-9:
            yield self._under_way.popleft()[1]
