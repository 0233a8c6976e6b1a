"""Limits of speed and acceleration of a base."""

from math import isfinite

from drivers.api import BaseLimits, Source, Velocity
from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest, DeviceFault

# Checks of commands, the same for every base.

LIGHTS = (1, 2)
"""Numbers of the lights of a base."""

MIN_TONE_FREQUENCY, MAX_TONE_FREQUENCY = 6.0, 20_000.0
MAX_TONE_DURATION = 0.255


def check(part: str, velocity: Velocity, source: Source) -> None:
    """Raise BadRequest if ``velocity`` is not finite or ``source`` is ``Source.SAFETY``; ``part`` names the base."""
    if not (isfinite(velocity.linear) and isfinite(velocity.angular)):
        raise BadRequest(
            f"{part}: cannot drive at {velocity.linear} m/s, {velocity.angular} rad/s",
            hint="both must be finite numbers",
        )
    if source is Source.SAFETY:
        raise BadRequest(f"{part}: only its own reflexes command in the name of safety", hint="use another source")


def require(part: str, latched: str) -> None:
    """Raise DeviceFault if the base ``part`` is latched; ``latched`` is the reason, empty if it is not latched."""
    if latched:
        raise DeviceFault(f"{part}: stopped: {latched}", hint="remove the cause, then enable the base")


def check_light(part: str, number: int) -> None:
    """Raise BadRequest if ``number`` is not that of a light; ``part`` names the base."""
    if number not in LIGHTS:
        raise BadRequest(f"{part}: no light {number}", hint=f"it has lights {' and '.join(map(str, LIGHTS))}")


def check_tone(part: str, frequency: float, seconds: float) -> None:
    """Raise BadRequest for a tone whose frequency (Hz) or duration (seconds) a base cannot play."""
    if not (MIN_TONE_FREQUENCY <= frequency <= MAX_TONE_FREQUENCY and 0 < seconds <= MAX_TONE_DURATION):
        raise BadRequest(
            f"{part}: no tone of {frequency} Hz for {seconds} s",
            hint=f"{MIN_TONE_FREQUENCY:g} to {MAX_TONE_FREQUENCY:g} Hz, for {MAX_TONE_DURATION} s at most",
        )


BRAKING_RATIO = 1.2
"""Ratio of the limits of deceleration and acceleration."""


@dataclass(frozen=True, slots=True)
class VelocityLimits:
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
    def as_base_limits(self) -> BaseLimits:
        """These limits as a ``drivers.api.BaseLimits``, the type that leaves use."""
        return BaseLimits(self.max_linear, self.max_angular, self.linear_acceleration, self.angular_acceleration)

    def clamp(self, velocity: Velocity) -> Velocity:
        """Return ``velocity``, scaled down to the speed limits: the path keeps its shape."""
        excess = max(1.0, abs(velocity.linear) / self.max_linear, abs(velocity.angular) / self.max_angular)
        if excess == 1.0:
            return velocity
        return Velocity(velocity.linear / excess, velocity.angular / excess)

    def approach(self, current: Velocity, setpoint: Velocity, seconds: float) -> Velocity:
        """Return the velocity ``seconds`` after ``current`` on the ramp to ``setpoint``.

        Both components change in proportion, so that the base stays on the same arc.
        """
        share = min(
            1.0,
            _share(current.linear, setpoint.linear, self.linear_acceleration * seconds),
            _share(current.angular, setpoint.angular, self.angular_acceleration * seconds),
        )
        if share == 1.0:
            return setpoint  # exactly, without a rounding error
        return Velocity(
            current.linear + share * (setpoint.linear - current.linear),
            current.angular + share * (setpoint.angular - current.angular),
        )


def _share(current: float, wanted: float, step: float) -> float:
    """Return the share of the change from ``current`` to ``wanted`` that is possible in a cycle; 1 or more for all.

    ``step`` is the change that the acceleration limit permits in a cycle. Braking may be ``BRAKING_RATIO`` times as
    fast.
    """
    change = wanted - current
    if change == 0.0:
        return 1.0
    return step * (BRAKING_RATIO if change * current < 0 else 1.0) / abs(change)
