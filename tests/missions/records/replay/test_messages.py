"""What nodes said while they ran is in a record, though their status was the same all the time."""

from pathlib import Path

import pytest

from behaviours.leaf import RUNNING
from behaviours.node import Node
from config.library import DEFAULT_ROBOT, find_file
from missions.executive.tick_record import TickRecord
from missions.library.drivers import load_robot
from missions.library.shipped import load_mission
from missions.plugins.records.recording.cut import cut_record
from missions.plugins.records.recording.recorder import FEEDBACK_INTERVAL
from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.plugins.records.replay.rerun import rerun
from missions.plugins.records.report.page import report_page
from missions.plugins.records.report.summary import study_record
from missions.request import RunRequest
from missions.runner import Runner
from missions.trees.drawing_builder import with_states
from missions.trees.states import state_after
from tests.missions.records.replay.written import record_of

Said = dict[float, dict[str, str]]
"""By the times of ticks, what each node that ran on said."""

MISSION = "mission: turning\ntree: {sequence: [{turn: 90 deg}, {wait: 1 s}, {turn: -90 deg}]}\n"

ROBOT = load_robot(find_file("robots", DEFAULT_ROBOT))


@pytest.fixture(scope="module")
def turning(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunRecord, Said]:
    folder, said = tmp_path_factory.mktemp("turning"), Said()
    (folder / "turning.yaml").write_text(MISSION)

    def remember(runner: Runner, moment: TickRecord) -> None:
        nodes = [node for node in runner.root.iterate() if isinstance(node, Node) and node.status is RUNNING]
        said[moment.t] = {node.key: node.reason for node in nodes}

    order = RunRequest(str(folder / "turning.yaml"), simulate="fast", eyes="truth")
    return record_of(order, folder / "turning.mcap", act=remember), said


def test_recorded_feedback_matches_the_live_view(turning: tuple[RunRecord, Said]) -> None:
    record, said = turning
    assert len({reason for told in said.values() for reason in told.values()}) > 20, "they say something new"
    for time, told in said.items():
        then = record.statuses(time)
        near = [words for t, words in said.items() if time - FEEDBACK_INTERVAL - 1e-6 <= t <= time]
        for key in told:
            assert then[key].reason in {words.get(key) for words in near}, (time, key)
            assert then[key].status == "running"


def test_feedback_does_not_change_the_start_of_a_status(turning: tuple[RunRecord, Said]) -> None:
    record, _ = turning
    (began,) = {change.t for _, change in record.status_history if change.node == "1.1" and change.status == "running"}
    assert record.statuses(began + 1.0)["1.1"].t == began


def test_pictures_and_reports_show_the_newest_message(turning: tuple[RunRecord, Said]) -> None:
    record, said = turning
    drawing = with_states(
        record.drawing(), {key: state_after(change) for key, change in record.statuses(1.0).items()}, 1.0
    )
    shown = {box.key: box.reason for box in drawing.root.walk()}["1.1"]
    assert shown in {told["1.1"] for t, told in said.items() if 0.79 <= t <= 1.0}
    assert shown in report_page(study_record(record))


def test_cut_record_keeps_the_last_feedback(turning: tuple[RunRecord, Said], tmp_path: Path) -> None:
    record, _ = turning
    cut_record(record, 1.05, 1.1, tmp_path / "piece.mcap")
    piece = open_record(tmp_path / "piece.mcap")
    assert piece.statuses(1.06)["1.1"].reason == record.statuses(1.06)["1.1"].reason != ""


def test_rerun_of_a_turn_is_identical(turning: tuple[RunRecord, Said]) -> None:
    record, _ = turning
    found = rerun(record, load_mission(str(record.header.paths[record.header.file]), complete=True), ROBOT)
    assert found.is_identical
    assert not found.reworded_count
