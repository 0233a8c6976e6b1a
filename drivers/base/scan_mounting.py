"""Mounting of a range finder on its robot: its position and yaw, and the beams that the robot itself blocks."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite, pi, tau

import numpy as np
import numpy.typing as npt

from drivers.api import Angles

BEAMS = 360
"""Number of beams of a scan: one for each degree."""

STEP = tau / BEAMS
START = -pi
"""Bearing in radians of the first beam: straight back. Beam ``BEAMS // 2`` points straight ahead."""

Place = tuple[float, float, float]
"""Mounting pose on the base: x forward and y left in metres, yaw in radians."""

Sector = tuple[float, float]
"""Sector about the base: two bearings in radians; it extends anticlockwise from the first to the second."""


@dataclass(frozen=True, slots=True)
class Mounting:
    """Mounting pose of a range finder on the base, and its ``blind`` sectors, which the robot itself blocks.

    Raises ValueError for a number that is not finite.
    """

    place: Place = (0.0, 0.0, 0.0)
    blind: Sequence[Sector] = ()
    hidden: npt.NDArray[np.bool_] = field(init=False, repr=False, compare=False)
    """Array of bool, shape (BEAMS,): True for the beams that are in a blind sector."""

    def __post_init__(self) -> None:
        numbers = (*self.place, *(bearing for sector in self.blind for bearing in sector))
        if not all(map(isfinite, numbers)):
            raise ValueError(f"range finder: place or blind sectors are not finite: {self.place}, {self.blind}")
        hidden = np.zeros(BEAMS, dtype=np.bool_)
        for first, second in self.blind:
            past = np.remainder(bearings() - first + 1e-9, tau)
            hidden |= past <= np.remainder(second - first, tau) + 2e-9
        object.__setattr__(self, "hidden", hidden)  # the way to fill in a field of a frozen class

    def bearing(self, clockwise: Angles) -> Angles:
        """Return bearings in the base's frame (radians, anticlockwise) for angles measured by the range finder.

        ``clockwise`` are angles in radians, clockwise from the front of the range finder.
        """
        return self.place[2] - clockwise


def bearings() -> Angles:
    """Return the bearings of the beams of a scan: shape (BEAMS,), radians from straight ahead, anticlockwise."""
    return START + STEP * np.arange(BEAMS, dtype=np.float64)


def beam(bearing: Angles) -> npt.NDArray[np.intp]:
    """Return the indices of the beams of a scan that are nearest to the given bearings in radians."""
    return np.rint((bearing - START) / STEP).astype(np.intp) % BEAMS
