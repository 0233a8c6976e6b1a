"""How fast the base may go, and how quickly it may change that. Pure arithmetic."""

from math import isfinite

from drivers.api import BaseLimits, Velocity
from drivers.api.quick import dataclass

BRAKING = 1.2
"""How much harder than it speeds up the base may slow down."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Greatest speeds (m/s, rad/s) and accelerations (m/s^2, rad/s^2). Raises ValueError unless all are positive."""

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
        """The same as behaviours are told of them."""
        return BaseLimits(self.max_linear, self.max_angular, self.linear_acceleration, self.angular_acceleration)

    def clamp(self, wanted: Velocity) -> Velocity:
        """Return ``wanted``, slowed down as a whole until it is within the limits: the path keeps its shape."""
        excess = max(1.0, abs(wanted.linear) / self.max_linear, abs(wanted.angular) / self.max_angular)
        if excess == 1.0:
            return wanted
        return Velocity(wanted.linear / excess, wanted.angular / excess)

    def approach(self, current: Velocity, wanted: Velocity, seconds: float) -> Velocity:
        """Return how fast to go ``seconds`` after ``current``, on the way to ``wanted``.

        Both components change in proportion, so a start or a stop keeps to the same arc.
        """
        share = min(
            1.0,
            _share(current.linear, wanted.linear, self.linear_acceleration * seconds),
            _share(current.angular, wanted.angular, self.angular_acceleration * seconds),
        )
        if share == 1.0:
            return wanted  # and not a rounding error beside it
        return Velocity(
            current.linear + share * (wanted.linear - current.linear),
            current.angular + share * (wanted.angular - current.angular),
        )


def _share(current: float, wanted: float, step: float) -> float:
    """Return how much of the change may be made now; more than 1 when there is room to spare."""
    change = wanted - current
    if change == 0.0:
        return 1.0
    return step * (BRAKING if change * current < 0 else 1.0) / abs(change)
