"""The summary: what it says of a run, and of what is not in the record."""

from dataclasses import replace
from math import nan
from pathlib import Path

from behaviours.joint_motion import JointError
from config.units import Quantity
from drivers.api import HeadPose
from missions.executive.events import Ended, FaultRaised, NodeChanged, VariableSet
from missions.executive.tick_record import TickRecord
from missions.plugins.records.recording.items import LossItem, PictureItem, ViewItem
from missions.plugins.records.recording.run_record import open_record
from missions.plugins.records.report.slider import slider_times
from missions.plugins.records.report.summary import (
    RecordStudy,
    reported_faults,
    study_record,
    summary_sentences,
    verdict,
)
from missions.plugins.records.report.tables import faults_table, log_table
from missions.trees.value_text import percept_text, percepts_text, value_text, variable_text
from perception.api import UNKNOWN, Marker, Scene, Thing
from tests.cases import each
from tests.missions.records.report.told_record import WHERE, Item, face, items, write
from tests.missions.views.pictures.drawn import HOSTILE


def said_of(tmp_path: Path, what: list[Item | LossItem], *, eyes: str = "pixels") -> list[str]:
    path = write(tmp_path / "other.mcap", what, head=replace(WHERE, eyes=eyes))
    return list(summary_sentences(study_record(open_record(path))))


def test_summary_describes_the_run_and_its_failure(found: RecordStudy) -> None:
    assert list(summary_sentences(found)) == [
        f"It failed after 6.00 s and 119 ticks: {HOSTILE}.",
        "Cause of the failure: drive (m.yaml, line 2), at 5.00 s.",
        "No other action failed.",
        "Longest action: track_face, 2.90 s (m.yaml, line 3).",
        f"1 fault report, first at 4.50 s: base offline: {HOSTILE}.",
        "1 of 119 ticks were more than a tick late, at most 80 ms at 3.00 s.",
        "The base drove 0.2 m and turned 0° in total.",
        "Tracking error: 11.5° root mean square, 11.5° at most, at 1.01 s.",
        "The battery went from 80 % to 74 %.",
        "It saw face 1: first at 1.01 s.",
    ]


def test_each_number_of_an_object_has_its_unit() -> None:
    assert value_text(HeadPose(0.5235988, -0.1)) == "HeadPose: pan 30 deg, tilt -5.7296 deg"
    assert value_text({"elbow": JointError(0.01, 0.1, 1.5, 40)}) == (
        "elbow: JointError: rms 0.573 deg, worst 5.7296 deg, at 1.5 s, readings 40"
    )
    assert value_text({}) == "nothing"


def test_quantity_of_a_record_has_its_unit() -> None:
    def told(value: object, dimension: str | None) -> str:
        return variable_text(VariableSet(0.0, 0, "", "x", value, dimension))

    assert told(28_800.0, "duration") == "28800 s"  # as a record has it
    assert told(Quantity(28_800.0, "duration", "8 h"), "duration") == "8 h"  # as a run has it
    assert told(0.2, "share") == "20 %"
    assert (told(3, None), told(None, None), told(nan, "length")) == ("3", "nothing", "nan")


def test_other_failed_actions_are_summarised(tmp_path: Path) -> None:
    lost = [NodeChanged(t, 20, "1.1", "track_face", "track_face", 1, "failure", "lost it") for t in (1.0, 2.0)]
    told = said_of(tmp_path, [*items(), *lost])
    assert "Other actions failed twice, first track_face (m.yaml, line 3), at 1.00 s: lost it." in told


def test_initial_online_status_is_not_a_fault(found: RecordStudy) -> None:
    assert [(event.part, event.status) for event in reported_faults(found.record)] == [
        ("base", "offline"),
        ("base", "online"),
    ]


def test_summary_without_faults_and_failures_is_explicit(tmp_path: Path) -> None:
    end = Ended(1.0, "m", "success", "", 1.0, 20)
    told = said_of(tmp_path, [FaultRaised(0.0, "base", "online", ""), end], eyes="")
    assert told == [
        "It succeeded after 1.00 s and 20 ticks.",
        "No action failed.",
        "No part of the robot reported a fault.",
        "It used no camera.",
    ]


def test_startup_time_is_reported_but_not_on_the_timeline(tmp_path: Path) -> None:
    late = [item for item in items() if not isinstance(item, TickRecord | NodeChanged) or item.t >= 3.0]
    path = write(tmp_path / "late.mcap", late)
    found = study_record(open_record(path))
    assert list(summary_sentences(found))[1] == "The robot took 3.00 s to get ready."
    assert (found.slider.start, found.slider.end) == (3.0, 6.0)
    assert min(time for drawn in found.charts for line in drawn.lines for time, _ in line.points) >= 3.0


def test_summary_of_an_incomplete_record_omits_the_result(tmp_path: Path) -> None:
    told = said_of(tmp_path, [item for item in items() if not isinstance(item, Ended)])
    assert told[0] == "The record ends at 6.00 s, before the mission did; the result of the mission is not recorded."


def test_losses_and_absent_percepts_are_reported(tmp_path: Path) -> None:
    blind = [replace_view(item) for item in items() if not isinstance(item, PictureItem)]
    told = said_of(tmp_path, [*blind, LossItem({"/camera": 3}, "the disk was slow")])
    assert told[-2:] == [
        "It saw no face, object or marker.",
        "The record is incomplete: 3 messages lost (3 on /camera).",
    ]
    unseen = [item for item in blind if not isinstance(item, ViewItem)]
    assert said_of(tmp_path, [*unseen])[-1] == "Its percepts are not recorded."


def replace_view(item: Item) -> Item:
    return item._replace(view=replace(item.view, faces=())) if isinstance(item, ViewItem) else item


def test_interrupted_run_is_reported_as_stopped(tmp_path: Path) -> None:
    path = write(tmp_path / "stopped.mcap", [Ended(1.0, "m", "interrupted", "Ctrl-C", 1.0, 20)])
    assert verdict(open_record(path)) == ("interrupted", "It was stopped after 1.00 s and 20 ticks: Ctrl-C.")


def test_part_back_online_is_not_a_fault_and_named_once(tmp_path: Path) -> None:
    gone = FaultRaised(1.0, "base", "offline", "base: no report")
    path = write(tmp_path / "back.mcap", [gone, FaultRaised(2.0, "base", "online", "base: reports again")])
    record = open_record(path)
    assert "1 fault report, first at 1.00 s: base offline: no report." in list(summary_sentences(study_record(record)))
    table = str(faults_table(record, slider_times(record)))
    assert ("! base offline" in table, "✓ base online" in table, "base: " in table) == (True, True, False)


def test_log_table_contains_speech_and_notices(found: RecordStudy) -> None:
    table = str(log_table(found.record, slider_times(found.record)))
    assert all(words in table for words in ("the robot", "<td>Anna</td><td>Hello</td>", "notice", "Anna was met"))


BALL = Thing(4, 1.0, face(1.0).box, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0, float("nan"), "", "red", "ball")
ROVER = Marker(5, 1.0, face(1.0).box, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 7, "", 0.0)


def test_named_percepts_are_called_by_name() -> None:
    assert percept_text(face(1.0)) == "face 1, 1.5 m, 11° left"
    assert percept_text(replace(face(1.0), name="Anna")) == "Anna, 1.5 m, 11° left"
    assert percept_text(replace(face(1.0), name=UNKNOWN)) == "face 1, 1.5 m, 11° left"
    assert percept_text(BALL) == "red ball, 29° right"
    assert percept_text(replace(BALL, name="the ball", bearing=float("nan"))) == "the ball, straight ahead"
    assert (
        percepts_text([ROVER, replace(ROVER, name="R2")])
        == "marker 7, 2.0 m, straight ahead; R2, 2.0 m, straight ahead"
    )
    assert percepts_text([]) == "nothing found"


@each(
    ("value", "words"),
    [
        (True, "yes"),
        (None, "nothing"),
        (0.25, "0.25"),
        ([], "nothing"),
        ([face(1.0), BALL], "face 1, 1.5 m, 11° left, red ball, 29° right"),
        (Scene(1.0, 100.0, 20.0), "Scene: stamp 1, brightness 100, contrast 20"),
        ("two\nlines", "two lines"),
        ("x" * 500, "x" * 119 + "…"),
    ],
)
def test_values_of_variables_are_short_words_on_one_line(value: object, words: str) -> None:
    assert value_text(value) == words
