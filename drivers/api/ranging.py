"""What a behaviour sees of a range finder: the distances all around, as one value."""

from collections.abc import Mapping
from math import inf, tau
from typing import Protocol

from drivers.api.arrays import Angles, Ranges
from drivers.api.device import Device, Reading
from drivers.api.marks import fixed
from drivers.api.quick import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class RangeScan:
    """One turn of a range finder.

    ``ranges``: shape (n,), float32, metres from the finder, NaN where nothing came back. Beam i points ``start + i *
    step`` radians from straight ahead of the *base*, anticlockwise positive (REP 103): how the finder is built in is
    worked in already. ``stamp`` (seconds of the driver's clock) is the middle of the turn, ``number`` counts from 0.
    It measures from ``least`` to ``most`` metres.
    """

    ranges: Ranges
    start: float
    step: float
    stamp: float
    number: int
    least: float
    most: float

    def figures(self) -> Mapping[str, float]:
        """Return what is shown of it, in metres."""
        return {"nearest": self.nearest()}

    def bearings(self) -> Angles:
        """Return where each beam points: shape (n,), radians, wrapped to -pi..pi."""
        import numpy as np  # noqa: PLC0415 - see drivers.api.arrays

        return wrapped(self.start + self.step * np.arange(len(self.ranges), dtype=np.float64))

    def nearest(self, centre: float = 0.0, width: float = tau) -> float:
        """Return the least distance (m) within ``width`` radians about the bearing ``centre``; infinity for none."""
        import numpy as np  # noqa: PLC0415

        off = np.abs(wrapped(self.bearings() - centre))
        inside = self.ranges[off <= width / 2 + 1e-9]
        seen = inside[np.isfinite(inside)]
        return float(seen.min()) if seen.size else inf


def wrapped(angles: Angles) -> Angles:
    """Return the same directions as angles from -pi to pi."""
    import numpy as np  # noqa: PLC0415

    turned: Angles = np.remainder(angles + tau / 2, tau) - tau / 2
    return turned


class Ranger(Device, Protocol):
    """A range finder that turns; its part of the robot is ``range``."""

    @property
    @fixed
    def place(self) -> tuple[float, float, float]:
        """Where it sits on the base: x forward and y left in metres, and its yaw in radians."""
        ...

    def scan(self) -> Reading[RangeScan]:
        """Return the newest whole turn; stale after half a second without another."""
        ...
