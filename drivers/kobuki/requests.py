"""What may be asked of a base, and how it is refused: the same for the real one and its twin."""

from collections.abc import Mapping
from math import isfinite
from types import MappingProxyType

from drivers.api import Lamp, Source, Tune, Velocity
from drivers.errors import BadRequest, DeviceFault
from drivers.kobuki import commands
from drivers.kobuki.commands import OUTPUTS_AT_START, Output, Sound

_LIGHTS: Mapping[int, tuple[Output, Output]] = MappingProxyType(
    {1: (Output.LED1_RED, Output.LED1_GREEN), 2: (Output.LED2_RED, Output.LED2_GREEN)}
)
LIGHTS = tuple(_LIGHTS)
"""The numbers of the lights."""


class Outputs:
    """What is switched on. It begins as the base does; not safe between threads."""

    def __init__(self) -> None:
        self.word = OUTPUTS_AT_START

    def light(self, number: int, colour: Lamp) -> None:
        """Let a light show a colour: red and green together are orange. Raises KeyError for another number."""
        red, green = _LIGHTS[number]
        for output, colours in ((red, (Lamp.RED, Lamp.ORANGE)), (green, (Lamp.GREEN, Lamp.ORANGE))):
            self.word = self.word | output if colour in colours else self.word & ~output


TUNES: Mapping[Tune, commands.Tune] = MappingProxyType({tune: commands.Tune[tune.name] for tune in Tune})
"""The tunes by what they are called, as the base numbers them."""

LOWEST, HIGHEST = 6.0, 20_000.0
MAX_TONE_DURATION = 0.255


def check(who: str, velocity: Velocity, source: Source) -> None:
    """Raise BadRequest for a velocity that is not finite, and for commands in the name of the reflexes."""
    if not (isfinite(velocity.linear) and isfinite(velocity.angular)):
        raise BadRequest(
            f"{who}: cannot drive at {velocity.linear} m/s, {velocity.angular} rad/s",
            hint="both must be finite numbers",
        )
    if source is Source.SAFETY:
        raise BadRequest(f"{who}: only its own reflexes command in the name of safety", hint="use another source")


def require(who: str, latched: str) -> None:
    """Raise DeviceFault while a base is latched, for the reason given."""
    if latched:
        raise DeviceFault(f"{who}: stopped: {latched}", hint="remove the cause, then enable the base")


def check_light(who: str, number: int) -> None:
    """Raise BadRequest for a light that there is not."""
    if number not in LIGHTS:
        raise BadRequest(f"{who}: no light {number}", hint=f"it has lights {' and '.join(map(str, LIGHTS))}")


def tone(who: str, frequency: float, seconds: float) -> Sound:
    """Return one tone of ``frequency`` hertz. Raises BadRequest for one that the base cannot play."""
    if not (LOWEST <= frequency <= HIGHEST and 0 < seconds <= MAX_TONE_DURATION):
        raise BadRequest(
            f"{who}: no tone of {frequency} Hz for {seconds} s",
            hint=f"{LOWEST:g} to {HIGHEST:g} Hz, for {MAX_TONE_DURATION} s at most",
        )
    return Sound.of(frequency, seconds)
