"""Time as the nodes see it while they are explored: instants and spans that ask the zone, or a choice, when compared.

They are floats only so that whatever shows a time in a message can do so; their own value means nothing.
"""

from typing import Self

from config.units import written
from missions.testing.verify.choices import Oracle
from missions.testing.verify.zone import START, Rows, Zone


class Timing:
    """The clock of an exploration (a drivers.clock.Clock) and all that is known about instants in one step."""

    def __init__(self, oracle: Oracle) -> None:
        self.oracle = oracle
        self.set(START)

    def set(self, rows: Rows) -> None:
        """Begin a step at which ``rows`` are known."""
        self.zone = Zone(rows)
        self._now = Instant(self, self.zone.now)

    def now(self) -> float:
        """Return the present instant."""
        return self._now

    def at_least(self, later: int, earlier: int, seconds: float) -> bool:
        """Say whether so much time lies between two instants: what follows from what is known, else a choice."""
        zone = self.zone
        enough = (-seconds, 1)  # earlier - later <= -seconds
        short = (seconds, 0)  # later - earlier < seconds
        over = zone.allows(earlier, later, enough)
        if over and zone.allows(later, earlier, short):
            over = self.oracle.choose(
                (False, True), lambda yes: f"{written(seconds, 'duration')} are over" if yes else ""
            )
        if over:
            zone.demand(earlier, later, enough)
        else:
            zone.demand(later, earlier, short)
        return over


class Some(float):
    """A time that nobody knows: every comparison of it is a choice."""

    oracle: Oracle

    @classmethod
    def of(cls, oracle: Oracle) -> Self:
        """Return one that asks ``oracle``. It is shown as a second."""
        made = cls(1.0)
        made.oracle = oracle
        return made

    def __sub__(self, other: float) -> float:
        return self

    def __gt__(self, other: float) -> bool:
        return self.passed()

    def passed(self) -> bool:
        """Choose whether it is over."""
        return self.oracle.choose((False, True), lambda yes: "the time is over" if yes else "")


class Instant(float):
    """A moment: the instant at ``place`` in the zone, and some seconds after it."""

    timing: Timing
    place: int
    offset: float

    def __new__(cls, timing: Timing, place: int, offset: float = 0.0) -> Self:
        """Make one; a float takes its value when it is made."""
        made = super().__new__(cls, 0.0)
        made.timing, made.place, made.offset = timing, place, offset
        return made

    def __add__(self, seconds: float) -> float:
        return seconds if isinstance(seconds, Some) else Instant(self.timing, self.place, self.offset + seconds)

    def __sub__(self, other: float) -> float:
        if not isinstance(other, Instant):
            return self + -other
        return Span(self.timing, self.place, other.place, self.offset - other.offset)

    def __lt__(self, other: float) -> bool:
        return not self - other >= 0.0

    def __ge__(self, other: float) -> bool:
        return self - other >= 0.0


class Span(float):
    """The time between two instants, and some seconds more."""

    timing: Timing
    later: int
    earlier: int
    more: float

    def __new__(cls, timing: Timing, later: int, earlier: int, more: float) -> Self:
        """Make one; a float takes its value when it is made."""
        made = super().__new__(cls, 0.0)
        made.timing, made.later, made.earlier, made.more = timing, later, earlier, more
        return made

    def __ge__(self, seconds: float) -> bool:
        if isinstance(seconds, Some):
            return seconds.passed()
        return self.timing.at_least(self.later, self.earlier, seconds - self.more)

    def __gt__(self, seconds: float) -> bool:
        return not self.timing.at_least(self.earlier, self.later, self.more - seconds)
