"""What can happen to a reply on its way: it is lost, damaged, cut, late or in pieces, by chance but repeatably."""

from collections import Counter
from dataclasses import dataclass, field
from random import Random

MAX_DELAY = 0.03
"""Seconds by which a late reply is late at most: longer than any host waits."""

MAX_PAUSE = 0.002
"""Seconds between the two pieces of a split reply at most: a host must wait for the second."""


@dataclass(slots=True)
class FaultInjection:
    """The share of replies (0..1) that each mishap befalls, and what the chance of ``seed`` has made of it so far.

    ``drop``: it never comes; ``truncate``: its end is missing; ``flip``: one bit is wrong; ``split``: it comes in two
    pieces; ``late``: it comes up to ``MAX_DELAY`` late; ``noise``: up to eight bytes of nonsense come first. ``echo``
    is the share of requests that the adapter hands back to the computer: 1 for a plain one-wire adapter.
    """

    seed: int = 0
    drop: float = 0.0
    flip: float = 0.0
    split: float = 0.0
    noise: float = 0.0
    echo: float = 0.0
    late: float = 0.0
    truncate: float = 0.0
    happened: Counter[str] = field(default_factory=Counter, init=False)
    _chance: Random = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Start the chance."""
        self._chance = Random(self.seed)  # noqa: S311  # it must be repeatable, and guards nothing

    def disturb(self, reply: bytes) -> list[tuple[float, bytes]]:
        """Return what becomes of ``reply``: pieces, each with the seconds by which it is late. Empty if it is lost."""
        if self._befalls("drop", self.drop):
            return []
        if self._befalls("truncate", self.truncate):
            reply = reply[: self._chance.randrange(1, len(reply))]
        if self._befalls("flip", self.flip):
            place, bit = self._chance.randrange(len(reply)), 1 << self._chance.randrange(8)
            reply = reply[:place] + bytes((reply[place] ^ bit,)) + reply[place + 1 :]
        if self._befalls("noise", self.noise):
            reply = self._chance.randbytes(self._chance.randint(1, 8)) + reply
        delay = self._chance.uniform(0, MAX_DELAY) if self._befalls("late", self.late) else 0.0
        if len(reply) > 1 and self._befalls("split", self.split):
            cut = self._chance.randrange(1, len(reply))
            return [(delay, reply[:cut]), (delay + self._chance.uniform(0, MAX_PAUSE), reply[cut:])]
        return [(delay, reply)]

    def echoes(self) -> bool:
        """Whether the next request comes back to the computer."""
        return self._befalls("echo", self.echo)

    def _befalls(self, what: str, share: float) -> bool:
        if self._chance.random() >= share:
            return False
        self.happened[what] += 1
        return True
