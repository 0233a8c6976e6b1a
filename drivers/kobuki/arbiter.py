"""Which of several commands a base obeys: that of the most important source which has asked lately."""

from collections.abc import Mapping
from math import inf
from types import MappingProxyType

from drivers.api import COMMAND_LIFE, Source, Velocity

HOLD: Mapping[Source, float] = MappingProxyType({Source.TELEOP: 1.0, Source.MISSION: COMMAND_LIFE})
"""Seconds for which a source keeps the wheels after its last command. A command itself is good for ``COMMAND_LIFE``: a
person who lets go of the keys stands still for the rest of the second, and only then the mission goes on. The order
is that of importance; reflexes are above them all, and never ask."""


class Arbiter:
    """Knows who asked for what. Not safe between threads."""

    def __init__(self) -> None:
        self._asked: dict[Source, tuple[Velocity, float]] = {}

    def ask(self, source: Source, wanted: Velocity, now: float) -> None:
        """Note what a source wants at ``now`` seconds."""
        self._asked[source] = (wanted, now)

    def forget(self, source: Source | None = None) -> None:
        """Forget what a source wants; what anybody does, for None."""
        if source is None:
            self._asked.clear()
        else:
            self._asked.pop(source, None)

    def decide(self, now: float) -> tuple[Source | None, Velocity | None]:
        """Return who has the wheels at ``now``, and what is wanted of them: None for nothing, or nothing any more."""
        for source, hold in HOLD.items():
            wanted, asked = self._asked.get(source, (None, -inf))
            if now - asked <= hold:
                return source, wanted if now - asked <= COMMAND_LIFE else None
        return None, None
