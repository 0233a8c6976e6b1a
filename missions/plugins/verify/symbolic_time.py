"""Symbolic time of an exploration: instants without numbers, of which only bounds on their differences are known.

These bounds are a zone. A comparison whose result does not follow from the zone is a choice of the exploration.
Instants and durations are floats only so that messages can format them; their float value has no meaning.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from typing import Self

from config.units import quantity_text
from missions.plugins.verify.choices import Oracle

# Zones: bounds on the time between any two instants.
#
# The timed automata of Alur and Dill (1994), with the difference bound matrices of Dill (1989): ``bounds[i][j]``
# limits how much later instant i was than instant j. The last instant is now. A zone stands for every timing within
# its bounds, so one state of the exploration stands for infinitely many real ones, and no timing is left out.

Bound = tuple[float, int]
"""Upper bound on the difference of two instants: seconds, and 1 if the bound itself is allowed, else 0."""

UNBOUNDED: Bound = (inf, 0)
ZERO_BOUND: Bound = (0.0, 1)

Rows = tuple[tuple[Bound, ...], ...]


def add_bounds(a: Bound, b: Bound) -> Bound:
    """Return the sum of two bounds, rounded, so that sums of the same seconds compare as equal."""
    return round(a[0] + b[0], 6), a[1] & b[1]


class Zone:
    """Upper bounds on the difference of any two instants: a difference bound matrix, changed in place during a step.

    ``bounds[i][j]`` limits how much later instant i is than instant j.
    """

    def __init__(self, rows: Iterable[Iterable[Bound]]) -> None:
        self.bounds = [list(row) for row in rows]

    @classmethod
    def of_ticks(cls, count: int) -> Self:
        """Return the zone of all instants of a run with ``count`` ticks, each of them later than the one before."""
        ticks = range(count)
        return cls([ZERO_BOUND if i <= j else UNBOUNDED for j in ticks] for i in ticks)

    @property
    def now(self) -> int:
        """Index of the present instant, the last."""
        return len(self.bounds) - 1

    def allows(self, i: int, j: int, bound: Bound) -> bool:
        """Return whether instant i can be later than j by at most ``bound``."""
        return add_bounds(bound, self.bounds[j][i]) >= ZERO_BOUND

    def is_over(self, since: int, seconds: float) -> bool:
        """Return whether at least ``seconds`` have passed since an instant, in all timings of the zone."""
        return self.bounds[since][self.now] <= (-seconds, 1)

    def constrain(self, i: int, j: int, bound: Bound) -> None:
        """Add the constraint that instant i is later than j by at most ``bound``, and tighten all others."""
        rows = self.bounds
        if bound >= rows[i][j]:
            return
        to_j = list(rows[j])
        for row in rows:
            way = add_bounds(row[i], bound)
            for k, rest in enumerate(to_j):
                row[k] = min(row[k], add_bounds(way, rest))

    def add(self, later: int, earlier: int, seconds: float, over: bool) -> bool:
        """Add the constraint that ``seconds`` have passed between two instants, or not; return whether that can be."""
        i, j, bound = (earlier, later, (-seconds, 1)) if over else (later, earlier, (seconds, 0))
        can = self.allows(i, j, bound)
        self.constrain(i, j, bound)
        return can

    def project(self, keep: Iterable[int]) -> Rows:
        """Return the bounds on the instants ``keep`` and now; other instants have no effect on them."""
        chosen = (*keep, self.now)
        return tuple(tuple(self.bounds[i][j] for j in chosen) for i in chosen)

    def advance(self, keep: Mapping[int, float]) -> Rows:
        """Return the zone after an unknown time, with the instants ``keep`` in this order, and the present instant.

        ``keep`` maps each instant to the longest wait from it: ages beyond that are not distinguished.
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
"""Zone (bounds on the differences of instants) before the first tick, with the present instant only."""


def extrapolate(rows: Rows, seconds: Sequence[float]) -> Rows:
    """Return a zone with looser bounds, each of them one of ``seconds`` (sorted), 0, or the negative of such a number.

    This removes sums, such as the multiples of 2 s within a minute, which would give too many states.
    """
    steps = [*(-second for second in reversed(seconds)), 0.0, *seconds]

    def loose(bound: Bound) -> Bound:
        if bound[0] in steps:
            return bound
        return next(((step, 1) for step in steps if step > bound[0]), UNBOUNDED)

    return tuple(tuple(map(loose, row)) for row in rows)


def includes(rows: Rows, others: Rows) -> bool:
    """Return whether the zone ``rows`` allows every timing of the zone ``others``, of the same instants."""
    pairs = zip(rows, others, strict=True)
    return all(bound >= other for row, others_row in pairs for bound, other in zip(row, others_row, strict=True))


class SymbolicClock:
    """Clock of an exploration (a drivers.clock.Clock), with the zone of the present step: its bounds on instants.

    ``decisions`` are the comparisons in the step: the later and the earlier instant, seconds, and whether these have
    passed between the two.
    """

    def __init__(self, oracle: Oracle) -> None:
        self.oracle = oracle
        self.set(INITIAL_ZONE)

    def set(self, rows: Rows) -> None:
        """Begin a step of the exploration with the zone ``rows``: known bounds on the time between two instants."""
        self.zone = Zone(rows)
        self.decisions: list[tuple[int, int, float, bool]] = []
        self._now = Instant(self, self.zone.now)

    def now(self) -> float:
        """Return the present instant."""
        return self._now

    def has_elapsed(self, later: int, earlier: int, seconds: float) -> bool:
        """Return whether ``seconds`` have passed between two instants: implied by the zone, otherwise a choice."""
        zone = self.zone
        over = zone.allows(earlier, later, (-seconds, 1))
        if over and zone.allows(later, earlier, (seconds, 0)):
            over = self.oracle.choose(
                (False, True), lambda yes: f"{quantity_text(seconds, 'duration')} are over" if yes else ""
            )
        zone.add(later, earlier, seconds, over)
        self.decisions.append((later, earlier, seconds, over))
        return over


class UnknownTime(float):
    """Unknown time: every comparison is a choice."""

    oracle: Oracle
    label: str

    @classmethod
    def of(cls, oracle: Oracle, label: str) -> Self:
        """Return an unknown time with choices of ``oracle``; ``label`` is its node in traces: "'delay' (line 4)"."""
        time = cls(1.0)
        time.oracle, time.label = oracle, label
        return time

    def __sub__(self, other: float) -> float:
        return self

    def __gt__(self, other: float) -> bool:
        return self.is_over()

    def is_over(self) -> bool:
        """Return whether the time is over, as a new choice at each call."""
        return self.oracle.choose((False, True), lambda yes: f"the time of {self.label} is over" if yes else "")


class Instant(float):
    """Instant number ``place`` of a zone plus an ``offset`` in seconds."""

    timing: SymbolicClock
    place: int
    offset: float

    def __new__(cls, timing: SymbolicClock, place: int, offset: float = 0.0) -> Self:
        instant = super().__new__(cls, 0.0)
        instant.timing, instant.place, instant.offset = timing, place, offset
        return instant

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
    """Duration between two instants plus an offset in seconds."""

    timing: SymbolicClock
    later: int
    earlier: int
    more: float

    def __new__(cls, timing: SymbolicClock, later: int, earlier: int, more: float) -> Self:
        duration = super().__new__(cls, 0.0)
        duration.timing, duration.later, duration.earlier, duration.more = timing, later, earlier, more
        return duration

    def __ge__(self, seconds: float) -> bool:
        if isinstance(seconds, UnknownTime):
            return seconds.is_over()
        return self.timing.has_elapsed(self.later, self.earlier, seconds - self.more)

    def __gt__(self, seconds: float) -> bool:
        return not self.timing.has_elapsed(self.earlier, self.later, self.more - seconds)
