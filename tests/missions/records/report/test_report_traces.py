"""What is drawn over time: which charts there are, what they leave out, and how well something was followed."""

import re
from dataclasses import replace
from itertools import pairwise
from math import degrees
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from missions.executive.events import NodeChanged, VariableSet
from missions.plugins.records.recording.items import ViewItem
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.report.chart import chart_figure, percent_along, round_numbers
from missions.plugins.records.report.slider import SliderTimes
from missions.plugins.records.report.summary import RecordStudy, study_record
from missions.plugins.records.report.traces import (
    CHART_COLUMNS,
    MAX_GAP,
    Chart,
    ChartLine,
    make_charts,
    split_at_gaps,
    thin_points,
    tracking_rms,
)
from missions.trees.drawing import TreeBox, TreeDrawing
from perception.api import View
from tests.missions.records.report.told_record import Item, face, write

values = st.floats(-1e6, 1e6)
series = st.lists(st.tuples(st.floats(0, 100), values), min_size=1, max_size=3000).map(sorted)


def test_everything_that_moved_has_a_chart(found: RecordStudy) -> None:
    assert [(drawn.key, [line.name for line in drawn.lines]) for drawn in found.charts] == [
        ("speed", ["setpoint", "measured"]),
        ("pan", ["setpoint", "measured"]),
        ("tracking", ["horizontal", "vertical"]),
        ("battery", ["charge"]),
    ]


def test_chart_begins_with_the_value_at_its_start(found: RecordStudy) -> None:
    def battery(begin: float) -> list[tuple[float, float]]:
        (line,) = next(drawn for drawn in make_charts(found.record, [], begin) if drawn.key == "battery").lines
        return list(line.points)

    whole = battery(0.0)
    before, after = whole[4], whole[5]
    begin = (before[0] + after[0]) / 2
    assert battery(begin) == [(begin, before[1]), *whole[5:]]


def test_angles_are_in_degrees_and_setpoint_leads_measurement(found: RecordStudy) -> None:
    pan = next(drawn for drawn in found.charts if drawn.key == "pan")
    asked, measured = (dict(line.points) for line in pan.lines)
    time = max(asked)
    assert measured[time] == pytest.approx(degrees(0.05 * time), abs=0.2)
    assert asked[time] - measured[time] == pytest.approx(degrees(0.02), abs=0.2)


def test_route_length_equals_the_distance_driven(found: RecordStudy) -> None:
    assert found.route.length == pytest.approx(0.2, abs=0.02)
    assert found.route.rotation == 0.0


def test_tracking_error_is_measured_while_the_face_is_followed(found: RecordStudy) -> None:
    assert [miss.time for miss in found.tracking_errors] == pytest.approx([1.01, 2.01])
    assert {round(miss.horizontal, 6) for miss in found.tracking_errors} == {round(degrees(0.2), 6)}
    assert tracking_rms(found.tracking_errors) == pytest.approx(degrees(0.2))


def two_faces(tmp_path: Path, box: TreeBox, *more: Item) -> list[float]:
    """Record a leaf that follows one of two faces, of which the first goes away; return by how much it was off."""
    near, far = face(1.0, bearing=0.1), face(1.0, number=2, bearing=0.3)
    views = [
        ViewItem(1.0, View(1.0, (near, far))),
        ViewItem(2.0, View(2.0, (replace(far, stamp=2.0), replace(near, stamp=2.0)))),
    ]
    ran = [NodeChanged(t, 1, "1", box.kind, box.kind, 1, status, "") for t, status in ((0.5, "running"), (2.5, "idle"))]
    what = sorted([*views, *ran, *more], key=lambda item: item.t)
    record = open_record(write(tmp_path / "two.mcap", what, drawing=TreeDrawing("m", "", "m.yaml", box)))
    return [round(miss.horizontal, 3) for miss in study_record(record).tracking_errors]


def test_tracking_error_keeps_the_face_that_was_largest_at_first(tmp_path: Path) -> None:
    box = TreeBox("1", "follow_person", "follow_person", "■", "m.yaml", 1)
    assert two_faces(tmp_path, box) == [round(degrees(0.1), 3)] * 2


def test_tracking_error_uses_the_face_named_by_the_mission(tmp_path: Path) -> None:
    box = TreeBox("1", "track_face", "track_face", "■", "m.yaml", 1, arguments={"face": "${person}"})
    known = VariableSet(0.1, 1, "", "person", face(0.1, number=2))
    assert two_faces(tmp_path, box, known) == [round(degrees(0.3), 3)] * 2


def test_leaves_that_do_not_track_have_no_tracking_error(tmp_path: Path) -> None:
    assert two_faces(tmp_path, TreeBox("1", "find_face", "find_face", "■", "m.yaml", 1)) == []


def test_a_line_has_a_gap_where_nothing_is_known() -> None:
    points = [(0.0, 1.0), (0.5, 1.0), (0.6 + MAX_GAP, 2.0), (0.7 + MAX_GAP, 2.0)]
    assert list(split_at_gaps(points)) == [points[:2], points[2:]]
    assert list(split_at_gaps([])) == []


@given(series)
def test_thinned_line_keeps_ends_and_peaks_and_is_short(
    points: list[tuple[float, float]],
) -> None:
    thin = thin_points(points, 0.0, 100.0)
    assert set(thin) <= set(points)
    assert thin == sorted(thin)
    assert (thin[0], thin[-1]) == (points[0], points[-1])
    assert {min(value for _, value in each) for each in (thin, points)} == {min(value for _, value in points)}
    assert {max(value for _, value in each) for each in (thin, points)} == {max(value for _, value in points)}
    assert len(thin) <= 4 * (CHART_COLUMNS + 1)


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e5), st.integers(2, 8))
def test_round_numbers_are_few_even_and_within(low: float, span: float, count: int) -> None:
    numbers = round_numbers(low, low + span, count)
    assert 2 <= len(numbers) <= count + 2
    assert all(low - 1e-6 * span <= number <= low + span * (1 + 1e-6) for number in numbers)
    steps = {round((other - one) / span, 6) for one, other in pairwise(numbers)}
    assert len(steps) <= 1


def test_a_scale_has_two_numbers_at_least() -> None:
    assert round_numbers(-4.7, 4.6, 3) == [-2.5, 0.0, 2.5]


@given(series, st.sampled_from(["%", "°"]))
def test_chart_line_stays_within_its_chart(points: list[tuple[float, float]], unit: str) -> None:
    moments = SliderTimes([0.0, 100.0], [0, 1])
    text = str(chart_figure(Chart("x", "X", unit, [ChartLine("x", points)]), moments))
    path = re.findall(r"[-\d.]+", text.partition(' d="')[2].partition('"')[0])
    assert all(0.0 <= float(number) <= 1000.0 for number in path)


def test_time_is_a_percentage_of_the_record() -> None:
    assert percent_along(15.0, SliderTimes([10.0, 30.0], [0, 1])) == "25.000%"
