"""The places of the slider, and what holds at each."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from missions.plugins.records.recording.cut import cut_record
from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.plugins.records.report.slider import (
    TextTable,
    failure_positions,
    slider_times,
    status_changes,
    value_at,
    variable_histories,
)
from missions.plugins.records.report.summary import RecordStudy
from missions.trees.drawing import SIGNS
from missions.trees.states import states_at
from tests.missions.records.report.told_record import END, FAILED
from tests.missions.views.pictures.drawn import HOSTILE


def test_slider_has_every_tick_and_the_end(found: RecordStudy) -> None:
    moments = found.slider
    assert (moments.start, moments.end, len(moments.times)) == (0.1, END, 119)
    assert moments.ticks[:3] == [1, 2, 3]
    assert moments.ticks[-1] == 119


def test_something_between_two_ticks_is_known_at_the_next(found: RecordStudy) -> None:
    moments = found.slider
    assert moments.times[moments.position(1.0)] == 1.0
    assert moments.times[moments.position(1.01)] == pytest.approx(1.05)
    assert moments.position(99.0) == len(moments.times) - 1
    assert moments.position(-1.0) == 0


def test_the_page_has_the_statuses_of_the_record_at_every_place(record: RunRecord, found: RecordStudy) -> None:
    texts = TextTable()
    rows = status_changes(record, found.slider, texts)
    said, statuses = texts.all(), list(SIGNS)
    for place, time in enumerate(found.slider.times):
        shown = {key: row for key, each in rows.items() if (row := value_at(each, place)) is not None}
        truth = states_at(record.events, time)
        assert {key: (statuses[row[1]], said[row[2]]) for key, row in shown.items()} == {
            key: (now.status, now.reason) for key, now in truth.items()
        }


def test_slider_failures_name_the_node_that_failed_first(record: RunRecord, found: RecordStudy) -> None:
    moments = found.slider
    assert [(moments.times[place], first.kind) for place, first in failure_positions(record, moments)] == [
        (FAILED, "drive"),
        (END, "sequence"),
    ]


def test_variables_are_described_with_their_submission(record: RunRecord, found: RecordStudy) -> None:
    texts = TextTable()
    shown = variable_histories(record, found.drawing, found.slider, texts)
    said = texts.all()
    assert [(each.submission, each.name, [said[row[1]] for row in each.rows]) for each in shown] == [
        ("", "patience", ["5 s"]),
        ("", "greeting", [HOSTILE]),
        ("", "person", ["face 1, 1.5 m, 11° left"]),
        ("go", "person", ["nothing"]),
    ]


def test_slider_of_a_cut_record_begins_with_the_state_at_its_start(record: RunRecord, tmp_path: Path) -> None:
    cut_record(record, 3.5, 4.5, tmp_path / "piece.mcap")
    with (tmp_path / "piece.mcap").open("rb") as file:
        assert make_reader(file).get_summary() is not None
    piece = open_record(tmp_path / "piece.mcap")
    moments = slider_times(piece)
    assert moments.start == 3.5
    row = value_at(status_changes(piece, moments, TextTable())["1.2.1"], 0)
    assert row is not None
    assert row[:2] == (0, list(SIGNS).index("running"))
