"""Time series of a run for charts: speed, head, battery, tracking error, and the path of the base."""

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from math import degrees, dist, fsum, pi, remainder, sqrt, tau

from missions.executive.events import VariableSet
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.report.sightings import Views
from missions.plugins.records.report.timeline import Lane
from missions.trees.drawing import TreeBox
from missions.trees.value_text import percept_name
from perception.api import Marker, Percept, Thing, View

# Tracking error: angle of the target from the camera axis.
#
# A record does not contain the target of a leaf. It is inferred by the rule of the leaves: the percept that the file
# names, else the first and largest one, as long as it is in view.

FOLLOWED_PERCEPTS = {
    "track_face": "faces",
    "follow_person": "faces",
    "track_object": "things",
    "track_robot": "markers",
}
"""Leaves that follow a percept with the camera, and the field of a view that holds their possible targets."""

_VARIABLE = re.compile(r"\$\{\s*(\w+)\s*\}")


@dataclass(frozen=True, slots=True)
class TrackingError:
    """Tracking error: the angle (degrees) from the camera axis to the followed percept at ``time`` (s).

    Left and down are positive.
    """

    time: float
    horizontal: float
    vertical: float

    @property
    def largest(self) -> float:
        """The horizontal or vertical error, whichever is larger, as an absolute value."""
        return max(abs(self.horizontal), abs(self.vertical))


def tracking_errors(record: RunRecord, views: Views, lanes: Sequence[Lane]) -> list[TrackingError]:
    """Return the tracking error in each view that shows the percept which a running leaf follows."""
    following = sorted(
        ((bar.start, bar.end, lane.box) for lane in lanes if lane.box.kind in FOLLOWED_PERCEPTS for bar in lane.bars),
        key=lambda each: each[:2],
    )
    if not following:
        return []
    variables = [event for event in record.events if isinstance(event, VariableSet)]
    errors: list[TrackingError] = []
    for start, end, box in following:
        target = _initial_target(box, variables, start)
        for time, view in views:
            if not start <= time <= end:
                continue
            percept = _followed_percept(box, view, target)
            if percept is not None and max(abs(percept.bearing), abs(percept.elevation)) <= pi:
                target = percept.id
                errors.append(TrackingError(time, degrees(percept.bearing), degrees(percept.elevation)))
    return sorted(errors, key=lambda miss: miss.time)


def tracking_rms(errors: Sequence[TrackingError]) -> float:
    """Return the root mean square of tracking errors, in degrees; 0 without errors."""
    return sqrt(fsum(miss.largest**2 for miss in errors) / len(errors)) if errors else 0.0


def _initial_target(box: TreeBox, variables: Sequence[VariableSet], start: float) -> int | None:
    """Return the id of the percept that a leaf is to follow, by an argument such as ``face: ${person}``; else None.

    ``variables`` are the recorded values, ``start`` is the time (s) at which the leaf started.
    """
    for text in box.arguments.values():
        named = _VARIABLE.fullmatch(text)
        known = [
            event
            for event in variables
            if named is not None
            and event.t <= start
            and event.name == named[1]
            and (not event.scope or box.key.startswith(f"{event.scope}."))
        ]
        # A sub-mission has its own variables: the innermost scope wins.
        newest = max(known, key=lambda event: (len(event.scope), event.t), default=None)
        if newest is not None and isinstance(newest.value, Percept):
            return newest.value.id
    return None


def _followed_percept(box: TreeBox, view: View, target: int | None) -> Percept | None:
    """Return the percept that a leaf follows in a view; None if the view does not show it.

    It is the percept with the id ``target``; if that is None, the first percept of the right kind.
    """
    fresh = [percept for percept in _candidates(box, view) if percept.stamp == view.looked]
    tracked = next((percept for percept in fresh if percept.id == target), None)
    return tracked or (fresh[0] if fresh and target is None else None)


def _candidates(box: TreeBox, view: View) -> Iterator[Percept]:
    wanted = next((box.arguments[name] for name in ("what", "which") if name in box.arguments), "")
    percepts: Sequence[Percept] = getattr(view, FOLLOWED_PERCEPTS[box.kind])
    for percept in percepts:
        named = isinstance(percept, Thing | Marker) and wanted and "${" not in wanted
        if not named or wanted in (percept_name(percept), str(getattr(percept, "number", ""))):
            yield percept


Points = Sequence[tuple[float, float]]
"""Points of a chart line: times (s) and values, in order of time."""

MAX_GAP = 1.0
"""Seconds without a value after which a chart line is interrupted."""

CHART_COLUMNS = 600
"""Number of columns of a chart for which points are kept: its horizontal resolution."""

MIN_ROUTE_LENGTH = 0.05
"""Minimum length (m) of the base's path for it to be drawn; noise of the odometry makes shorter paths."""

MIN_VALUE_RANGE = 1e-6
"""Minimum difference between largest and smallest value of a chart; constant values have no chart."""


@dataclass(frozen=True, slots=True)
class ChartLine:
    """A line of a chart; ``requested`` marks setpoints, which are dashed and drawn below the measured line."""

    name: str
    points: Points
    requested: bool = False


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart of one or more lines over time in one ``unit``; ``key`` is the stem of its file name."""

    key: str
    title: str
    unit: str
    lines: Sequence[ChartLine]

    @property
    def values(self) -> list[float]:
        """All values of all lines of the chart."""
        return [value for line in self.lines for _, value in line.points]


@dataclass(frozen=True, slots=True)
class BaseRoute:
    """Path of the base: ``poses`` as x, y (m) and heading (rad), and their times (s)."""

    times: Sequence[float]
    poses: Sequence[tuple[float, float, float]]

    @property
    def length(self) -> float:
        """Path length in metres, by odometry."""
        return sum(dist(one[:2], other[:2]) for one, other in pairwise(self.poses))

    @property
    def rotation(self) -> float:
        """Total rotation of the base in both directions, in radians."""
        return sum(abs(remainder(other[2] - one[2], tau)) for one, other in pairwise(self.poses))


def make_charts(record: RunRecord, errors: Sequence[TrackingError], begin: float = 0.0) -> list[Chart]:
    """Return the charts of a record from ``begin`` (s) on; constant values have no chart."""
    found = [
        _requested_and_measured("speed", "Speed", "m/s", record, "base.requested_speed", "base.speed", float, begin),
        _requested_and_measured("turn", "Turn rate", "°/s", record, "base.requested_turn", "base.turn", degrees, begin),
        _requested_and_measured(
            "pan", "Head pan (left is +)", "°", record, "head.requested_pan", "head.pan", degrees, begin
        ),
        _requested_and_measured(
            "tilt", "Head tilt (down is +)", "°", record, "head.requested_tilt", "head.tilt", degrees, begin
        ),
        Chart(
            "tracking",
            "Tracking error, from the middle of the picture",
            "°",
            [
                ChartLine("horizontal", [(miss.time, miss.horizontal) for miss in errors]),
                ChartLine("vertical", [(miss.time, miss.vertical) for miss in errors], requested=True),
            ],
        ),
        Chart(
            "battery", "Battery", "%", [ChartLine("charge", _series_points(record, "battery.percent", float, begin))]
        ),
    ]
    return [chart for chart in found if chart.values and max(chart.values) - min(chart.values) > MIN_VALUE_RANGE]


def base_route(record: RunRecord) -> BaseRoute:
    """Return the path of the base; empty if unknown."""
    series = [record.series(f"base.{name}") for name in ("x", "y", "heading")]
    known = [dict(zip(times, values, strict=True)) for times, values in series]
    times = [time for time in series[0][0] if all(time in each for each in known)]
    return BaseRoute(times, [(known[0][time], known[1][time], known[2][time]) for time in times])


def split_at_gaps(points: Points) -> Iterator[Points]:
    """Yield the segments of a chart line between its gaps."""
    stretch: list[tuple[float, float]] = []
    for point in points:
        if stretch and point[0] - stretch[-1][0] > MAX_GAP:
            yield stretch
            stretch = []
        stretch.append(point)
    if stretch:
        yield stretch


def thin_points(points: Points, begin: float, span: float) -> list[tuple[float, float]]:
    """Return the points that are visible in a chart of ``span`` seconds from ``begin`` on.

    The chart is divided into ``CHART_COLUMNS`` columns. From each, the first, last, lowest and highest point are kept.
    """
    found: list[tuple[float, float]] = []
    for _, column in groupby(points, key=lambda point: int((point[0] - begin) / span * CHART_COLUMNS)):
        inside = list(column)
        value: Callable[[tuple[float, float]], float] = lambda point: point[1]  # noqa: E731 - twice
        kept = {inside[0], min(inside, key=value), max(inside, key=value), inside[-1]}
        found += sorted(kept)
    return found


def _requested_and_measured(
    key: str,
    title: str,
    unit: str,
    record: RunRecord,
    requested: str,
    measured: str,
    convert: Callable[[float], float],
    begin: float,
) -> Chart:
    lines = [
        ChartLine("setpoint", _series_points(record, requested, convert, begin), requested=True),
        ChartLine("measured", _series_points(record, measured, convert, begin)),
    ]
    return Chart(key, title, unit, [line for line in lines if line.points])


def _series_points(record: RunRecord, name: str, convert: Callable[[float], float], begin: float) -> Points:
    """Return a time series of a record from ``begin`` (s) on, starting with the value valid at that time."""
    times, values = record.series(name)
    first = max(0, bisect_right(times, begin) - 1)
    return [(max(time, begin), convert(value)) for time, value in zip(times[first:], values[first:], strict=True)]
