"""Time as the nodes see it while they are explored: instants and spans that ask the zone, or a choice, when compared.

They are floats only so that whatever shows a time in a message can do so; their own value means nothing.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from typing import Self

from config.units import quantity_text
from missions.plugins.verify.choices import Oracle

# Zones: all that is known of when things happened, as bounds on the time between any two instants.
#
# The timed automata of Alur and Dill (1994), with the difference bound matrices of Dill (1989): ``bounds[i][j]``
# limits how much later instant i was than instant j. The last instant is now. A zone stands for every timing within
# its bounds, so one state of the exploration stands for infinitely many real ones, and no timing is left out.

Bound = tuple[float, int]
"""Seconds, and 1 where exactly so much is possible, 0 where it must be less."""

UNBOUNDED: Bound = (inf, 0)
ZERO_BOUND: Bound = (0.0, 1)

Rows = tuple[tuple[Bound, ...], ...]


def add_bounds(a: Bound, b: Bound) -> Bound:
    """Return the bound on a way of two steps; rounded, so that sums of the same seconds are the same."""
    return round(a[0] + b[0], 6), a[1] & b[1]


class Zone:
    """Bounds on the differences of instants, changed in place while a tick asks."""

    def __init__(self, rows: Iterable[Iterable[Bound]]) -> None:
        self.bounds = [list(row) for row in rows]

    @property
    def now(self) -> int:
        """The place of the present instant, the last."""
        return len(self.bounds) - 1

    def allows(self, i: int, j: int, bound: Bound) -> bool:
        """Say whether i can be later than j by no more than ``bound``."""
        return add_bounds(bound, self.bounds[j][i]) >= ZERO_BOUND

    def constrain(self, i: int, j: int, bound: Bound) -> None:
        """Let i be later than j by no more than ``bound``, and draw all conclusions."""
        rows = self.bounds
        if bound >= rows[i][j]:
            return
        to_j = list(rows[j])
        for row in rows:
            way = add_bounds(row[i], bound)
            for k, rest in enumerate(to_j):
                row[k] = min(row[k], add_bounds(way, rest))

    def advance(self, keep: Mapping[int, float]) -> Rows:
        """Return the zone of some time after now, with the instants ``keep`` alone, in that order, and a new now.

        How long ago one of them was does not matter beyond the longest time that anything waits for from it on: that
        is what ``keep`` holds of each.
        """
        old = self.bounds
        rows = [[*(old[i][j] for j in keep), old[i][self.now]] for i in keep]
        for place, (row, longest) in enumerate(zip(rows, keep.values(), strict=True)):
            if row[-1] <= (-longest, 1):
                for other in rows:
                    other[place] = UNBOUNDED
                rows[place] = [UNBOUNDED] * len(keep) + [(-longest, 1)]
                rows[place][place] = ZERO_BOUND
        return (*map(tuple, rows), (*(UNBOUNDED for _ in keep), ZERO_BOUND))


INITIAL_ZONE: Rows = ((ZERO_BOUND,),)
"""The zone before the first tick: nothing has happened yet."""


def extrapolate(rows: Rows, seconds: Sequence[float]) -> Rows:
    """Return a larger zone whose bounds are among ``seconds`` (sorted), 0, and their negatives.

    What it takes off are sums, such as how often 2 s go into a minute, that could go on for too many steps.
    """
    steps = [*(-second for second in reversed(seconds)), 0.0, *seconds]

    def loose(bound: Bound) -> Bound:
        if bound[0] in steps:
            return bound
        return next(((step, 1) for step in steps if step > bound[0]), UNBOUNDED)

    return tuple(tuple(map(loose, row)) for row in rows)


class SymbolicClock:
    """The clock of an exploration (a drivers.clock.Clock) and all that is known about instants in one step."""

    def __init__(self, oracle: Oracle) -> None:
        self.oracle = oracle
        self.set(INITIAL_ZONE)

    def set(self, rows: Rows) -> None:
        """Begin a step at which ``rows`` are known."""
        self.zone = Zone(rows)
        self._now = Instant(self, self.zone.now)

    def now(self) -> float:
        """Return the present instant."""
        return self._now

    def has_elapsed(self, later: int, earlier: int, seconds: float) -> bool:
        """Say whether so much time lies between two instants: what follows from what is known, else a choice."""
        zone = self.zone
        enough = (-seconds, 1)  # earlier - later <= -seconds
        short = (seconds, 0)  # later - earlier < seconds
        over = zone.allows(earlier, later, enough)
        if over and zone.allows(later, earlier, short):
            over = self.oracle.choose(
                (False, True), lambda yes: f"{quantity_text(seconds, 'duration')} are over" if yes else ""
            )
        if over:
            zone.constrain(earlier, later, enough)
        else:
            zone.constrain(later, earlier, short)
        return over


class UnknownTime(float):
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
        return self.is_over()

    def is_over(self) -> bool:
        """Choose whether it is over."""
        return self.oracle.choose((False, True), lambda yes: "the time is over" if yes else "")


class Instant(float):
    """A moment: the instant at ``place`` in the zone, and some seconds after it."""

    timing: SymbolicClock
    place: int
    offset: float

    def __new__(cls, timing: SymbolicClock, place: int, offset: float = 0.0) -> Self:
        """Make one; a float takes its value when it is made."""
        made = super().__new__(cls, 0.0)
        made.timing, made.place, made.offset = timing, place, offset
        return made

    def __add__(self, seconds: float) -> float:
        return seconds if isinstance(seconds, UnknownTime) else Instant(self.timing, self.place, self.offset + seconds)

    def __sub__(self, other: float) -> float:
        if not isinstance(other, Instant):
            return self + -other
        return SymbolicDuration(self.timing, self.place, other.place, self.offset - other.offset)

    def __lt__(self, other: float) -> bool:
        return not self - other >= 0.0

    def __ge__(self, other: float) -> bool:
        return self - other >= 0.0


class SymbolicDuration(float):
    """The time between two instants, and some seconds more."""

    timing: SymbolicClock
    later: int
    earlier: int
    more: float

    def __new__(cls, timing: SymbolicClock, later: int, earlier: int, more: float) -> Self:
        """Make one; a float takes its value when it is made."""
        made = super().__new__(cls, 0.0)
        made.timing, made.later, made.earlier, made.more = timing, later, earlier, more
        return made

    def __ge__(self, seconds: float) -> bool:
        if isinstance(seconds, UnknownTime):
            return seconds.is_over()
        return self.timing.has_elapsed(self.later, self.earlier, seconds - self.more)

    def __gt__(self, seconds: float) -> bool:
        return not self.timing.has_elapsed(self.earlier, self.later, self.more - seconds)
