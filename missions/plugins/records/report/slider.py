"""The moments that the slider of a report stops at, and all that its script must know to show any of them.

Whatever happens belongs to a place on the slider: its number, counted from 0. So a tick shows as a whole or not at all.
"""

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from missions.executive.events import NodeChanged, Ticked, VariableSet
from missions.plugins.records.recording.read import Record
from missions.trees.draw import one_line
from missions.trees.drawing import SIGNS, Drawing
from missions.trees.words import variable_in_words

Rows = dict[str, list[tuple[int, ...]]]
"""By key, what is new at which place."""

_NUMBERS: Mapping[str, int] = {status: number for number, status in enumerate(SIGNS)}
"""By which number the script is told a status."""


@dataclass(frozen=True, slots=True)
class Moments:
    """The places on the slider: ``times`` in seconds of the run, rising, and how many ``ticks`` there were by then."""

    times: Sequence[float]
    ticks: Sequence[int]

    @property
    def begin(self) -> float:
        """When the record begins."""
        return self.times[0]

    @property
    def end(self) -> float:
        """When the record ends."""
        return self.times[-1]

    @property
    def span(self) -> float:
        """How long it is, in seconds; a little where it is nothing, so that one can divide by it."""
        return max(self.end - self.begin, 1e-3)

    def place(self, time: float) -> int:
        """Return the first place at which something of ``time`` is known; the last one for all that comes after it."""
        return min(bisect_left(self.times, time), len(self.times) - 1)


class Texts:
    """Texts that occur again and again, by number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def number(self, text: str) -> int:
        """Return the number of a text, which is the same for the same text."""
        return self._numbers.setdefault(text, len(self._numbers))

    def all(self) -> list[str]:
        """Return the texts in the order of their numbers."""
        return list(self._numbers)


def moments_of(record: Record) -> Moments:
    """Return the moments of a record: its beginning, every tick, everything that nodes did besides, and its end.

    It begins with the first tick: before that the robot's parts were got ready, which may take long.
    """
    ticks = {event.t: event.tick for event in record.events if isinstance(event, Ticked)}
    other = [event.t for event in record.events if isinstance(event, NodeChanged)]
    begin = min((*ticks, *other), default=0.0) if record.cut_from is None else record.cut_from
    end = max(begin, record.until)
    times = sorted({begin, end, *(time for time in (*ticks, *other) if begin <= time <= end)})
    counts, count = [], 0
    for time in times:
        count = ticks.get(time, count)
        counts.append(count)
    return Moments(times, counts)


def changes(record: Record, moments: Moments, texts: Texts) -> Rows:
    """Return what each node and modifier was from which place on: the numbers of its status and of its reason."""
    rows: Rows = {}
    for time, change in record.states:
        row = moments.place(time), _NUMBERS[change.status], texts.number(one_line(change.reason))
        rows.setdefault(change.node, []).append(row)
    return rows


def failures(record: Record, moments: Moments) -> list[tuple[int, NodeChanged]]:
    """Return each place at which nodes have failed, and which was the first to fail there."""
    found: dict[int, NodeChanged] = {}
    for change in record.failures():
        found.setdefault(moments.place(change.t), change)
    return list(found.items())


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the mission, or of the one inside it that is called ``within``; ``rows`` are its values."""

    within: str
    name: str
    rows: Sequence[tuple[int, ...]]


def variables(record: Record, drawing: Drawing, moments: Moments, texts: Texts) -> list[Variable]:
    """Return all variables with their values in words: the place from which on, and the number of the text."""
    inner = {box.key: box.mission for box in drawing.root.walk() if box.mission}
    found: dict[tuple[str, str], list[tuple[int, ...]]] = {}
    for event in record.events:
        if isinstance(event, VariableSet):
            rows = found.setdefault((event.scope, event.name), [])
            # What a mission begins with, the head of a record has with its unit.
            written = "" if rows or event.scope else record.head.values.get(event.name, "")
            row = moments.place(event.t), texts.number(written or variable_in_words(event))
            if not rows or rows[-1][1] != row[1]:
                rows.append(row)
    return [Variable(inner.get(scope, scope), name, rows) for (scope, name), rows in found.items()]


def value_at(rows: Sequence[tuple[int, ...]], place: int) -> tuple[int, ...] | None:
    """Return what holds at a place: the newest of ``rows`` up to it."""
    return next((row for row in reversed(rows) if row[0] <= place), None)


def compact(times: Iterable[float]) -> list[float]:
    """Return times in tenths of milliseconds: shorter, and more than a reader needs."""
    return [round(time, 4) for time in times]
