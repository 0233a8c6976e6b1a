"""Limits of speed and acceleration of a base."""

from math import isfinite

from drivers.api import BaseLimits, Velocity
from drivers.api.quick import dataclass

BRAKING = 1.2
"""Ratio of the limits of deceleration and acceleration."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Maximum speeds (m/s, rad/s) and accelerations (m/s^2, rad/s^2). Raises ValueError unless all are positive."""

    max_linear: float
    max_angular: float
    linear_acceleration: float
    angular_acceleration: float

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"base: {name} must be a positive number, not {value}")

    @property
    def told(self) -> BaseLimits:
        """The same limits, as leaves see them."""
        return BaseLimits(self.max_linear, self.max_angular, self.linear_acceleration, self.angular_acceleration)

    def clamp(self, wanted: Velocity) -> Velocity:
        """Return ``wanted``, scaled down to the speed limits: the path keeps its shape."""
        excess = max(1.0, abs(wanted.linear) / self.max_linear, abs(wanted.angular) / self.max_angular)
        if excess == 1.0:
            return wanted
        return Velocity(wanted.linear / excess, wanted.angular / excess)

    def approach(self, current: Velocity, wanted: Velocity, seconds: float) -> Velocity:
        """Return the velocity ``seconds`` after ``current`` on the ramp to ``wanted``.

        Both components change in proportion, so that the base stays on the same arc.
        """
        share = min(
            1.0,
            _share(current.linear, wanted.linear, self.linear_acceleration * seconds),
            _share(current.angular, wanted.angular, self.angular_acceleration * seconds),
        )
        if share == 1.0:
            return wanted  # exactly, without a rounding error
        return Velocity(
            current.linear + share * (wanted.linear - current.linear),
            current.angular + share * (wanted.angular - current.angular),
        )


def _share(current: float, wanted: float, step: float) -> float:
    """Return the share of the change that one step permits; it may exceed 1."""
    change = wanted - current
    if change == 0.0:
        return 1.0
    return step * (BRAKING if change * current < 0 else 1.0) / abs(change)
