"""The moments that the slider of a report stops at, and all that its script must know to show any of them.

Whatever happens belongs to a place on the slider: its number, counted from 0. So a tick shows as a whole or not at all.
"""

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from missions.executive.events import NodeChanged, Ticked, VariableSet
from missions.plugins.records.recording.run_record import RunRecord
from missions.trees.drawing import SIGNS, TreeDrawing
from missions.trees.drawing_builder import one_line
from missions.trees.value_text import variable_text

ChangeRows = dict[str, list[tuple[int, ...]]]
"""By key, what is new at which place."""

_STATUS_NUMBERS: Mapping[str, int] = {status: number for number, status in enumerate(SIGNS)}
"""By which number the script is told a status."""


@dataclass(frozen=True, slots=True)
class SliderTimes:
    """The places on the slider: ``times`` in seconds of the run, rising, and how many ``ticks`` there were by then."""

    times: Sequence[float]
    ticks: Sequence[int]

    @property
    def start(self) -> float:
        """When the record begins."""
        return self.times[0]

    @property
    def end(self) -> float:
        """When the record ends."""
        return self.times[-1]

    @property
    def span(self) -> float:
        """How long it is, in seconds; a little where it is nothing, so that one can divide by it."""
        return max(self.end - self.start, 1e-3)

    def position(self, time: float) -> int:
        """Return the first place at which something of ``time`` is known; the last one for all that comes after it."""
        return min(bisect_left(self.times, time), len(self.times) - 1)


class TextTable:
    """Texts that occur again and again, by number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def index(self, text: str) -> int:
        """Return the number of a text, which is the same for the same text."""
        return self._numbers.setdefault(text, len(self._numbers))

    def all(self) -> list[str]:
        """Return the texts in the order of their numbers."""
        return list(self._numbers)


def slider_times(record: RunRecord) -> SliderTimes:
    """Return the moments of a record: its beginning, every tick, everything that nodes did besides, and its end.

    It begins with the first tick: before that the robot's parts were got ready, which may take long.
    """
    ticks = {event.t: event.tick for event in record.events if isinstance(event, Ticked)}
    other = [event.t for event in record.events if isinstance(event, NodeChanged)]
    begin = min((*ticks, *other), default=0.0) if record.cut_start is None else record.cut_start
    end = max(begin, record.end_time)
    times = sorted({begin, end, *(time for time in (*ticks, *other) if begin <= time <= end)})
    counts, count = [], 0
    for time in times:
        count = ticks.get(time, count)
        counts.append(count)
    return SliderTimes(times, counts)


def status_changes(record: RunRecord, slider: SliderTimes, texts: TextTable) -> ChangeRows:
    """Return what each node and modifier was from which place on: the numbers of its status and of its reason."""
    rows: ChangeRows = {}
    for time, change in record.status_history:
        row = slider.position(time), _STATUS_NUMBERS[change.status], texts.index(one_line(change.reason))
        rows.setdefault(change.node, []).append(row)
    return rows


def failure_positions(record: RunRecord, slider: SliderTimes) -> list[tuple[int, NodeChanged]]:
    """Return each place at which nodes have failed, and which was the first to fail there."""
    found: dict[int, NodeChanged] = {}
    for change in record.failures():
        found.setdefault(slider.position(change.t), change)
    return list(found.items())


@dataclass(frozen=True, slots=True)
class VariableHistory:
    """A variable of the mission, or of the one inside it that is called ``submission``; ``rows`` are its values."""

    submission: str
    name: str
    rows: Sequence[tuple[int, ...]]


def variable_histories(
    record: RunRecord, drawing: TreeDrawing, slider: SliderTimes, texts: TextTable
) -> list[VariableHistory]:
    """Return all variables with their values in words: the place from which on, and the number of the text."""
    inner = {box.key: box.mission for box in drawing.root.walk() if box.mission}
    found: dict[tuple[str, str], list[tuple[int, ...]]] = {}
    for event in record.events:
        if isinstance(event, VariableSet):
            rows = found.setdefault((event.scope, event.name), [])
            # What a mission begins with, the head of a record has with its unit.
            written = "" if rows or event.scope else record.header.values.get(event.name, "")
            row = slider.position(event.t), texts.index(written or variable_text(event))
            if not rows or rows[-1][1] != row[1]:
                rows.append(row)
    return [VariableHistory(inner.get(scope, scope), name, rows) for (scope, name), rows in found.items()]


def value_at(rows: Sequence[tuple[int, ...]], position: int) -> tuple[int, ...] | None:
    """Return what holds at a place: the newest of ``rows`` up to it."""
    return next((row for row in reversed(rows) if row[0] <= position), None)


def round_times(times: Iterable[float]) -> list[float]:
    """Return times in tenths of milliseconds: shorter, and more than a reader needs."""
    return [round(time, 4) for time in times]
