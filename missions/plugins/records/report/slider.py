"""Positions of the report's time slider, and the data of its script.

Positions are counted from 0. All changes of one tick have the same position, so a tick is shown completely or not at
all.
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
"""Changes of values, by node key: a list of tuples whose first number is the slider position of the change."""

_STATUS_NUMBERS: Mapping[str, int] = {status: number for number, status in enumerate(SIGNS)}
"""Number that stands for each node status in the data of the report's script."""


@dataclass(frozen=True, slots=True)
class SliderTimes:
    """Slider positions: their ``times`` (s of the run, rising), and the number of ``ticks`` at each."""

    times: Sequence[float]
    ticks: Sequence[int]

    @property
    def start(self) -> float:
        """Start of the record (s)."""
        return self.times[0]

    @property
    def end(self) -> float:
        """End of the record (s)."""
        return self.times[-1]

    @property
    def span(self) -> float:
        """Duration of the record in seconds, at least 1 ms, since it is used as a divisor."""
        return max(self.end - self.start, 1e-3)

    def position(self, time: float) -> int:
        """Return the first slider position at or after ``time`` (s), or the last one."""
        return min(bisect_left(self.times, time), len(self.times) - 1)


class TextTable:
    """Texts of the report page, each stored only once, and referred to by its number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def index(self, text: str) -> int:
        """Return the number of a text; equal texts have the same number."""
        return self._numbers.setdefault(text, len(self._numbers))

    def all(self) -> list[str]:
        """Return the texts in the order of their numbers."""
        return list(self._numbers)


def slider_times(record: RunRecord) -> SliderTimes:
    """Return the slider positions of a record: its beginning, every tick, every other status change, and its end.

    The slider begins with the first tick or status change, since getting the robot ready may take long.
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
    """Return the changes of each node and modifier: slider position, number of the status, and number of the reason."""
    rows: ChangeRows = {}
    for time, change in record.status_history:
        row = slider.position(time), _STATUS_NUMBERS[change.status], texts.index(one_line(change.reason))
        rows.setdefault(change.node, []).append(row)
    return rows


def failure_positions(record: RunRecord, slider: SliderTimes) -> list[tuple[int, NodeChanged]]:
    """Return each slider position at which nodes failed, with the first failure there."""
    found: dict[int, NodeChanged] = {}
    for change in record.failures():
        found.setdefault(slider.position(change.t), change)
    return list(found.items())


@dataclass(frozen=True, slots=True)
class VariableHistory:
    """Values of a variable of the mission, or of the sub-mission with the key ``submission``.

    ``rows`` are its changes: slider position, and number of the value's text in the ``TextTable``.
    """

    submission: str
    name: str
    rows: Sequence[tuple[int, ...]]


def variable_histories(
    record: RunRecord, drawing: TreeDrawing, slider: SliderTimes, texts: TextTable
) -> list[VariableHistory]:
    """Return the history of each variable; its values are added to ``texts``."""
    inner = {box.key: box.mission for box in drawing.root.walk() if box.mission}
    found: dict[tuple[str, str], list[tuple[int, ...]]] = {}
    for event in record.events:
        if isinstance(event, VariableSet):
            rows = found.setdefault((event.scope, event.name), [])
            # Initial values come from the record header, which keeps their units.
            written = "" if rows or event.scope else record.header.values.get(event.name, "")
            row = slider.position(event.t), texts.index(written or variable_text(event))
            if not rows or rows[-1][1] != row[1]:
                rows.append(row)
    return [VariableHistory(inner.get(scope, scope), name, rows) for (scope, name), rows in found.items()]


def value_at(rows: Sequence[tuple[int, ...]], position: int) -> tuple[int, ...] | None:
    """Return the last of ``rows`` whose first number, a slider position, is at most ``position``; None without one."""
    return next((row for row in reversed(rows) if row[0] <= position), None)


def round_times(times: Iterable[float]) -> list[float]:
    """Return times rounded to 0.1 ms, which makes the page smaller."""
    return [round(time, 4) for time in times]
