"""Digital outputs, lights and tunes of a Kobuki."""

from collections.abc import Mapping
from types import MappingProxyType

from drivers.api import Lamp, Tune
from drivers.kobuki import commands
from drivers.kobuki.commands import OUTPUTS_AT_START, Output

_LIGHTS: Mapping[int, tuple[Output, Output]] = MappingProxyType(
    {1: (Output.LED1_RED, Output.LED1_GREEN), 2: (Output.LED2_RED, Output.LED2_GREEN)}
)


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
