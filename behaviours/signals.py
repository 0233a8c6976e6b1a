"""Leaves for the sounder and the two lights of the base."""

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Lamp, Tune


class SoundLeaf(Leaf):
    """Play a tune of the base, or a tone.

    Succeeds at once; the sound plays on. A tone lasts for at most 255 ms.
    """

    tag = "sound"
    example = "- sound: cleaning_end"
    acts = True
    needs = frozenset({"base", "sounds"})
    tune: str | None = argument("choice", "name of the tune", default=None, choices=tuple(Tune), principal=True)
    tone: float | None = argument(
        "frequency", "frequency of a tone, instead of a tune", default=None, low=6.0, high=20_000.0
    )
    duration: float = argument("duration", "duration of the tone", default=0.1, low=0.005, high=0.255)

    def update(self) -> Status:
        if (self.tune is None) == (self.tone is None):
            return self.fail("needs either a tune or a tone")
        if self.tune is not None:
            self.robot.sounds.play(Tune(self.tune))
        elif self.tone is not None:
            self.robot.sounds.tone(self.tone, self.duration)
        return SUCCESS


class Led(Leaf):
    """Switch a light of the base.

    Succeeds at once; the light stays as it is.
    """

    tag = "led"
    example = "- led: {colour: green, number: 2}"
    acts = True
    needs = frozenset({"base", "lights"})
    colour: str = argument("choice", "colour of the light", choices=tuple(Lamp), principal=True)
    number: int = argument("count", "number of the light: 1 or 2", default=1, low=1, high=2)

    def update(self) -> Status:
        self.robot.lights.light(self.number, Lamp(self.colour))
        return SUCCESS
