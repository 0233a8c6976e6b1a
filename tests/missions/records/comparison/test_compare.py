"""Two runs side by side: where they first decide differently, what can be counted, and what cannot be compared."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from drivers.api import BaseState, Pose2D, Quality, Reading, Velocity
from missions.executive.events import NodeChanged
from missions.executive.tick_record import TickRecord
from missions.plugins.records.commands.record import command
from missions.plugins.records.comparison.runs import RunComparison, compare_runs
from missions.plugins.records.recording.record_header import RecordHeader
from missions.plugins.records.recording.run_record import open_record
from missions.trees.drawing import TreeDrawing
from tests.missions.records.report.test_report_joints import ARM, waves
from tests.missions.records.report.told_record import DRAWING, WHERE, Item, items, write

REAL = replace(WHERE, simulate="", robot="r")
DRIVE, SAY = "1.3.1", "1.2.1"


def changed(key: str, begin: float, *, by: float = 0.0, **other: Any) -> list[Item]:
    """Return the run in which what a node does from ``begin`` (s) on comes ``by`` seconds later, or is otherwise."""
    return sorted(
        (
            replace(item, t=item.t + by, **(other if item.node == key else {}))
            if isinstance(item, NodeChanged) and item.t >= begin
            else item
            for item in items()
        ),
        key=lambda item: item.t,
    )


def runs(
    tmp_path: Path, other: Sequence[Item], *, head: RecordHeader = REAL, drawing: TreeDrawing = DRAWING
) -> list[Path]:
    a = write(tmp_path / "a.mcap", items(), head=REAL)
    return [a, write(tmp_path / "b.mcap", other, head=head, drawing=drawing)]


def comparison(tmp_path: Path, other: Sequence[Item]) -> RunComparison:
    return compare_runs(*map(open_record, runs(tmp_path, other)))


def run(*arguments: object) -> Result:
    return CliRunner().invoke(command, ["compare", *map(str, arguments)])


def test_record_compared_with_itself_has_no_difference(tmp_path: Path) -> None:
    found = comparison(tmp_path, items())
    assert (found.first_difference, found.settings, found.nodes) == (None, {}, 7)
    assert {leaf.seconds.a == leaf.seconds.b for leaf in found.leaves} == {True}


def test_longer_leaf_is_not_a_different_decision(tmp_path: Path) -> None:
    found = comparison(tmp_path, changed(DRIVE, 4.0, by=0.5))
    assert found.first_difference is None
    assert {leaf.place.name: (leaf.seconds.b or 0.0) - leaf.seconds.a for leaf in found.leaves if leaf.seconds.a} == {
        "track_face": 0.0,
        "say": pytest.approx(0.5),
        "drive": 0.0,
    }


def test_first_leaf_with_another_result_is_reported(tmp_path: Path) -> None:
    path, other = runs(tmp_path, changed(DRIVE, 5.0, status="success", reason="there"))
    told = run(path, other).output
    assert "First different decision: drive (1.3.1), m.yaml, line 2:\n  A  5.00 s  failure (" in told
    assert "\n  B  5.00 s  success (there)\n" in told


def test_skipped_node_is_the_first_difference(tmp_path: Path) -> None:
    less = [item for item in items() if not (isinstance(item, NodeChanged) and item.node == SAY)]
    split = comparison(tmp_path, less).first_difference
    assert split is not None
    assert (split.place.key, split.changes.b) == (SAY, None)


def test_added_node_is_listed_and_does_not_shift_others(tmp_path: Path) -> None:
    first, *rest = DRAWING.root.children
    root = replace(DRAWING.root, children=(replace(first, key="1.9", kind="nod", name="nod"), first, *rest))
    path, other = runs(tmp_path, [*items(), NodeChanged(0.2, 4, "1.9", "nod", "nod", 1, "success", "")],
                       drawing=replace(DRAWING, root=root))  # fmt: skip
    found = json.loads(run(path, other, "--json").output)
    assert found["split"] is None
    assert [leaf["goes"] for leaf in found["leaves"] if leaf["name"] == "nod"] == [{"a": None, "b": 1}]


def test_differing_run_settings_are_listed(tmp_path: Path) -> None:
    path, other = runs(tmp_path, items(), head=replace(REAL, seed=8, values={"patience": "9 s"}))
    lines = [line.split() for line in run(path, other).output.splitlines()]
    assert ["seed", "7", "8"] in lines
    assert ["patience", "5", "s", "9", "s"] in lines


@pytest.mark.parametrize(
    ("head", "why"),
    [
        (replace(REAL, mission="n"), "is of the mission 'm', .* of 'n': only runs of one mission on one robot"),
        (replace(REAL, robot="s"), "is of the robot 'r', .* of 's': only runs of one mission on one robot"),
    ],
)
def test_other_missions_and_robots_are_refused_in_words(tmp_path: Path, head: RecordHeader, why: str) -> None:
    path, other = runs(tmp_path, items(), head=head)
    result = run(path, other)
    assert result.exit_code == 2
    assert re.search(why, " ".join(result.output.split()))


def test_trees_without_a_node_in_common_are_refused(tmp_path: Path) -> None:
    alone = TreeDrawing("m", "", "m.yaml", replace(DRAWING.root, kind="race", name="race", children=()))
    result = run(*runs(tmp_path, [], drawing=alone))
    assert (result.exit_code, "have no node in common" in result.output) == (2, True)


def test_file_that_is_not_a_record_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no.mcap").write_bytes(b"no")
    result = run(runs(tmp_path, items())[0], tmp_path / "no.mcap")
    assert (result.exit_code, "no.mcap" in result.output) == (1, True)


def walked(path: Path, aside: float, late: float) -> Path:
    """Record a base that drives 4 m ahead, drifts ``aside`` (m), and an elbow that is the more ``late`` the more."""
    ticks = []
    for n in range(1, 41):
        t, state = n / 10, waves(n / 10)
        joint = replace(state, position=(state.goal or 0.0) + late)
        base = BaseState(Pose2D(t, aside * t / 4, 0.0), Velocity(1.0, 0.0))
        ticks.append(
            TickRecord(
                "tick", n, t, 0.0, 0.0,
                [
                    ("base", "state", (), Reading(base, t, Quality.GOOD)),
                    ("arm", "states", (), {"elbow": Reading(joint, t, Quality.GOOD)}),
                ],
            )
        )  # fmt: skip
    begun = NodeChanged(0.1, 1, "1", "sequence", "sequence", 1, "running", "")
    return write(path, [begun, *ticks], head=REAL, files={"robot/r.yaml": ARM})


def test_ways_and_joints_stand_side_by_side(tmp_path: Path) -> None:
    path, other = walked(tmp_path / "a.mcap", 0.0, 0.01), walked(tmp_path / "b.mcap", 1.0, 0.02)
    found = compare_runs(open_record(path), open_record(other))
    assert found.max_distance is not None
    assert found.max_distance[0] == pytest.approx(1.0, abs=0.03)
    assert found.max_distance[1] == pytest.approx(3.9)
    elbow = found.joints["elbow"]
    assert elbow.a is not None
    assert elbow.b is not None
    assert elbow.b.rms == pytest.approx(2 * (elbow.a.rms or 0.0))
    told = run(path, other).output
    assert "They ended 1.00 m apart." in told
    assert [line.split()[:3] for line in told.splitlines() if line.startswith("elbow")] == [["elbow", "0.57", "1.15"]]
    assert json.loads(run(path, other, "--json").output)["ways"]["b"]["end"][1] == pytest.approx(1.0)
