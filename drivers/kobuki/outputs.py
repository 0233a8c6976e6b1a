"""The word that switches the base's sockets, supplies and lights. A light changes none of the others."""

from collections.abc import Mapping
from types import MappingProxyType

from drivers.api import Lamp
from drivers.kobuki.commands import OUTPUTS_AT_START, Output

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
