"""Leaves that make the base heard and seen: its tunes, and its two lights."""

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Lamp, Tune


class SoundLeaf(Leaf):
    """Play one of the base's tunes, or a tone.

    Succeeds at once; what sounds goes on by itself. A tone lasts for 255 ms at most.
    """

    tag = "sound"
    needs = frozenset({"base", "sounds"})
    tune: str | None = argument("choice", "which tune", default=None, choices=tuple(Tune), principal=True)
    tone: float | None = argument("frequency", "a tone instead", default=None, low=6.0, high=20_000.0)
    duration: float = argument("duration", "how long the tone is", default=0.1, low=0.005, high=0.255)

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

    Succeeds at once; the light stays so.
    """

    tag = "led"
    needs = frozenset({"base", "lights"})
    colour: str = argument("choice", "what it shows", choices=tuple(Lamp), principal=True)
    number: int = argument("count", "which: 1 or 2", default=1, low=1, high=2)

    def update(self) -> Status:
        self.robot.lights.light(self.number, Lamp(self.colour))
        return SUCCESS
