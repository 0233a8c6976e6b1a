"""The people of a world file: who they are, where they stand and walk, what they do and answer."""

from collections.abc import Iterator
from typing import Literal

from config.things import Walker
from drivers.api.keys import Mistake, key, keys

LOOKS = ("anna", "ben", "chidi", "dora", "emil", "farah")
"""The people that can be drawn."""

BODY = 0.25
"""Metres from somebody's middle to where a robot touches them."""

ANYTHING = "anything"
"""What ``hears`` says for whatever the robot says."""

REACTION = 0.6
"""Seconds from hearing something to doing something about it."""

EARSHOT = 4.0
"""Metres within which people hear what the robot says, unless the file says otherwise."""

Facing = float | Literal["camera", "away"]
"""An angle about z; or towards whoever looks, or away from them."""


@keys
class ActConfig:
    """What somebody does at a time, or ``after`` seconds from hearing something that contains ``hears``.

    One of ``at`` and ``hears`` is None; the empty ``hears`` is contained in everything. What somebody hears makes them
    do it so many ``times`` at most, 0 for always.
    """

    at: float | None = key("duration", default=None, low=0.0, help="When it is done, from the beginning.")
    phrase: str | None = key(
        default=None, word="hears", help=f"What of the robot's words sets it off; `{ANYTHING}` is whatever it says."
    )
    delay: float | None = key(
        "duration",
        default=None,
        word="after",
        low=0.0,
        high=60.0,
        help=f"How long after it: {REACTION} s if not given.",
    )
    say: str = key(default="", help="What they say then.")
    nod: bool = key(default=False, help="Whether they nod.")
    turn: Facing | None = key("angle", default=None, help="Which way they turn.")
    leave: bool = key(default=False, help="Whether they leave.")
    often: int | None = key(
        default=None, word="times", low=1, help="How often it can be set off; always where not given."
    )

    @property
    def hears(self) -> str | None:
        """What of the robot's words sets it off."""
        return "" if self.phrase == ANYTHING else self.phrase

    @property
    def after(self) -> float:
        """Seconds from hearing it."""
        return REACTION if self.delay is None else self.delay

    @property
    def times(self) -> int:
        """How often it can be set off; 0 for always."""
        return self.often or 0

    def mistakes(self) -> Iterator[Mistake]:
        """Yield what has no time, or two, or does nothing."""
        if (self.at is None) == (self.phrase is None):
            hint = "such as {at: 5 s, ...} or {hears: hello, ...}"
            yield Mistake("an act needs either 'at' or 'hears'", hint=hint)
        elif self.at is not None and self.delay is not None:
            yield Mistake("'after' is for what somebody hears; 'at' says when already")
        elif self.at is not None and self.often is not None:
            yield Mistake("'times' is for what somebody hears; what has a time is done once")
        if not (self.say or self.nod or self.leave or self.turn is not None):
            yield Mistake("nothing is done here", hint="an act needs one of: say, nod, turn, leave")


@keys
class PersonConfig(Walker):
    """Somebody who stands at (x, y) and, after ``start`` seconds, walks along ``path`` at ``speed`` m/s.

    ``height`` is that of the eyes. Somebody who is not ``known`` is a stranger to a robot that recognises people.
    ``hears_within`` is how far away from the robot they hear it, in metres.
    """

    look: str = key(default="anna", among=LOOKS, help="How they look.")
    height: float = key("length", default=1.6, low=0.8, high=2.1, help="How high their eyes are.")
    facing: Facing = key("angle", default="camera", help="Which way they look: an angle, or to the robot, or away.")
    acts: tuple[ActConfig, ...] = key(default=(), each="an act", help="What they do, and answer.")
    known: bool = key(default=True, help="Whether the robot knows their face.")
    hears_within: float = key("length", default=EARSHOT, low=0.0, high=50.0, help="How far away they hear the robot.")
