"""Checks of commands, the same for every base."""

from math import isfinite

from drivers.api import Source, Velocity
from drivers.errors import BadRequest, DeviceFault

LIGHTS = (1, 2)
"""Numbers of the lights."""

LOWEST, HIGHEST = 6.0, 20_000.0
MAX_TONE_DURATION = 0.255


def check(who: str, velocity: Velocity, source: Source) -> None:
    """Raise BadRequest for a velocity that is not finite, and for ``Source.SAFETY``."""
    if not (isfinite(velocity.linear) and isfinite(velocity.angular)):
        raise BadRequest(
            f"{who}: cannot drive at {velocity.linear} m/s, {velocity.angular} rad/s",
            hint="both must be finite numbers",
        )
    if source is Source.SAFETY:
        raise BadRequest(f"{who}: only its own reflexes command in the name of safety", hint="use another source")


def require(who: str, latched: str) -> None:
    """Raise DeviceFault if ``latched``, the reason of a latch, is not empty."""
    if latched:
        raise DeviceFault(f"{who}: stopped: {latched}", hint="remove the cause, then enable the base")


def check_light(who: str, number: int) -> None:
    """Raise BadRequest for an unknown light."""
    if number not in LIGHTS:
        raise BadRequest(f"{who}: no light {number}", hint=f"it has lights {' and '.join(map(str, LIGHTS))}")


def check_tone(who: str, frequency: float, seconds: float) -> None:
    """Raise BadRequest for a tone outside the range of frequencies in Hz and durations."""
    if not (LOWEST <= frequency <= HIGHEST and 0 < seconds <= MAX_TONE_DURATION):
        raise BadRequest(
            f"{who}: no tone of {frequency} Hz for {seconds} s",
            hint=f"{LOWEST:g} to {HIGHEST:g} Hz, for {MAX_TONE_DURATION} s at most",
        )
