"""How joints kept to their goals: what the figures are, where they are told, and what no file can do to them."""

import csv
import io
import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from math import nan, radians, sin, sqrt, tau
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from drivers.api import JointState, Quality, Reading
from missions.executive.tick_record import TickRecord
from missions.plugins.records.commands.record import command
from missions.plugins.records.recording.run_record import RunRecord, open_record
from missions.plugins.records.recording.tagged_values import to_json
from missions.plugins.records.recording.validation import InvalidRecordError
from missions.plugins.records.report.joints import MAX_JOINTS, JointFigures, joint_charts, joint_figures, joint_samples
from missions.plugins.records.report.page import report_page
from missions.plugins.records.report.plots import draw_plots
from missions.plugins.records.report.summary import study_record, summary_sentences
from missions.trees.drawing import to_json as drawing_to_json
from tests.cases import each
from tests.missions.records.recording.test_hostile_files import about
from tests.missions.records.recording.test_hostile_files import write as write_foreign
from tests.missions.records.report.told_record import DRAWING, WHERE, items, write
from tests.missions.views.pictures.drawn import HOSTILE

ARM = b"""robot: r
summary: An arm.
arm:
  driver: dynamixel
  port: /dev/null
  joints:
    elbow: {id: 1, model: AX-12A}
"""

STALL = 1.5
"""Nm of an AX-12A, as its maker says."""

AT_REST = JointState(0.0, 0.0, None, 0.0, 12.0, 35.0, moving=False, torque=True)

At = Callable[[float], JointState]


@pytest.fixture(scope="module", autouse=True)
def fonts() -> None:
    """Have Matplotlib open its fonts before the tests: it keeps their files open."""
    FigureCanvasAgg(figure := Figure())
    figure.suptitle("…")
    figure.savefig(io.BytesIO())


def waves(t: float) -> JointState:
    """Return a joint that follows a sine of 30 deg, and is 2 deg late at most: 3 deg beyond its goal at 1.5 s."""
    goal = radians(30) * sin(tau * t / 4)
    off = radians(3.0) if t == 1.5 else radians(2.0) * sin(tau * t)
    return JointState(goal + off, 1.0, goal, 0.5, 12.0, 35.0 + t, moving=True, torque=True)


def record_of(path: Path, *, real: bool = True, quality: Quality = Quality.GOOD, **joints: At) -> RunRecord:
    """Write a record of joints, ten times a second for 4 s."""
    ticks = [
        TickRecord(
            "tick", n, n / 10, 0.0, 0.0,
            [("arm", "states", (), {name: Reading(at(n / 10), n / 10, quality) for name, at in joints.items()})],
        )
        for n in range(1, 41)
    ]  # fmt: skip
    head = replace(WHERE, simulate="" if real else "fast")
    return open_record(write(path / "joints.mcap", ticks, head=head, files={"robot/r.yaml": ARM}))


def figures(record: RunRecord) -> dict[str, JointFigures]:
    return {each.name: each for each in joint_figures(record, joint_samples(record))}


def test_joint_error_has_rms_and_worst_with_its_time(tmp_path: Path) -> None:
    found = figures(record_of(tmp_path, elbow=waves))["elbow"]
    # Of a sine the mean square is half of its peak's; one sample of 40, at which it is 0, is 3 deg off instead.
    assert found.rms == pytest.approx(sqrt(2.0**2 / 2 + 3.0**2 / 40))
    assert found.worst == pytest.approx(3.0)
    assert (found.worst_at, found.samples) == (1.5, 40)
    assert found.hottest == 39.0


def test_energy_is_torque_times_speed_of_real_servos_only(tmp_path: Path) -> None:
    assert figures(record_of(tmp_path, elbow=waves))["elbow"].energy == pytest.approx(0.5 * STALL * 1.0 * 3.9)
    simulated = figures(record_of(tmp_path, real=False, elbow=waves))["elbow"]
    assert (simulated.energy, simulated.load) == (None, None)


def test_joint_driven_by_its_load_does_no_work(tmp_path: Path) -> None:
    record = record_of(tmp_path, elbow=lambda t: replace(waves(t), load=-0.5))
    assert figures(record)["elbow"].energy == 0.0


def test_energy_of_an_unknown_servo_is_none(tmp_path: Path) -> None:
    found = figures(record_of(tmp_path, wing=waves))["wing"]
    assert (found.energy, found.load) == (None, 0.5)


@each("state", [AT_REST, replace(waves(1.0), torque=False), replace(waves(1.0), goal=nan)])
def test_a_joint_without_a_goal_and_a_limp_one_have_no_error(tmp_path: Path, state: JointState) -> None:
    found = figures(record_of(tmp_path, elbow=lambda _: state))
    assert all((each.rms, each.worst, each.samples) == (None, None, 0) for each in found.values())


def test_stale_servo_readings_are_ignored(tmp_path: Path) -> None:
    assert figures(record_of(tmp_path, quality=Quality.STALE, elbow=waves)) == {}


def test_only_moving_joints_have_a_chart_of_goal_and_angle(tmp_path: Path) -> None:
    record = record_of(tmp_path, elbow=waves, wrist=lambda _: AT_REST)
    (drawn,) = joint_charts(joint_samples(record))
    assert (drawn.key, drawn.title, [(line.name, line.requested) for line in drawn.lines]) == (
        "joint_elbow",
        "elbow",
        [("goal", True), ("measured", False)],
    )
    assert {len(line.points) for line in drawn.lines} == {40}


def test_report_has_a_joints_section_with_the_worst_error(tmp_path: Path) -> None:
    found = study_record(record_of(tmp_path, elbow=waves))
    assert "Joint error: 1.49° root mean square, 3.0° at most (elbow, at 1.50 s)." in summary_sentences(found)
    assert "Work of the motors: 3 J." in summary_sentences(found)
    text = report_page(found)
    assert "<h2>Joints</h2>" in text
    assert "elbow, °" in text
    assert [path.name for path in draw_plots(found, tmp_path / "plots")] == ["joint_elbow.png"]


def test_report_without_joints_has_no_joints_section(tmp_path: Path) -> None:
    found = study_record(open_record(write(tmp_path / "m.mcap", items())))
    assert "<h2>Joints</h2>" not in report_page(found)


# --- the command ------------------------------------------------------------------------------------------------------


def run(*arguments: object) -> Result:
    return CliRunner().invoke(command, ["joints", *map(str, arguments)])


def test_joints_command_prints_table_json_and_csv(tmp_path: Path) -> None:
    path = record_of(tmp_path, elbow=waves).path
    told = run(path).output.splitlines()
    assert " ".join(told[0].split()) == "joint rms deg max deg at s motor J load % degC samples"
    assert told[1].split() == ["elbow", "1.49", "+3.0", "1.50", "2.9", "+50", "39", "40"]
    (joint,) = json.loads(run(path, "--json").output)["joints"]
    (row,) = csv.DictReader(io.StringIO(run(path, "--csv").output))
    assert joint["name"] == row["name"] == "elbow"
    assert joint["rms"] == pytest.approx(float(row["rms"])) == pytest.approx(1.4916, abs=1e-3)


def test_joints_command_reports_missing_joint_states(tmp_path: Path) -> None:
    result = run(write(tmp_path / "m.mcap", items()))
    assert (result.exit_code, result.output) == (0, "no joint states in this record\n")


# --- files from strangers ---------------------------------------------------------------------------------------------


def foreign(tmp_path: Path, joints: Iterable[tuple[str, dict[str, Any]]]) -> RunRecord:
    """Write a record of joints as a stranger would."""
    state = to_json(waves(1.0))
    assert isinstance(state, dict)
    tree = json.dumps(drawing_to_json(DRAWING)).encode()
    heard = {name: {"stamp": 1.0, "quality": "good", **state, **other} for name, other in joints}
    said = [("/state/arm", {"t": float(t), "joints": heard}) for t in range(3)]
    return open_record(write_foreign(tmp_path / "foreign.mcap", [about(), *said], {"tree.json": tree}))


@each("value", [1e308, -1e308, "nan", "inf", "-inf", 1e18])
@each("word", ["position", "velocity", "goal", "load", "temperature"])
def test_joints_with_impossible_numbers_are_ignored(tmp_path: Path, word: str, value: object) -> None:
    assert figures(foreign(tmp_path, [("elbow", {word: value}), ("wrist", {})])).keys() == {"wrist"}


@each("value", ["far", [], {}, 10**400, None])
def test_joint_position_that_is_not_a_number_is_refused(tmp_path: Path, value: object) -> None:
    record = foreign(tmp_path, [("elbow", {"position": value})])
    with pytest.raises(InvalidRecordError, match="damaged record"):
        joint_samples(record)


def test_largest_accepted_joint_values_can_be_plotted(tmp_path: Path) -> None:
    most = dict.fromkeys(("velocity", "goal", "load", "temperature"), 0.9e9)
    found = study_record(foreign(tmp_path, [("elbow", {"position": -0.9e9, **most})]))
    assert "NaN" not in report_page(found)
    list(draw_plots(found, tmp_path / "plots"))


def test_no_name_of_a_joint_is_markup_a_formula_or_a_path(tmp_path: Path) -> None:
    names = (HOSTILE, "=cmd()", "../../evil", "$", "", "a" * 10_000, "\x1b[2J")
    record = foreign(tmp_path, [(name, {"goal": 0.0}) for name in names])
    found = study_record(record)
    text = report_page(found)
    assert HOSTILE not in text
    assert "a" * 100 not in text
    assert "'=cmd()" in run(record.path, "--csv").output
    assert "\x1b" not in run(record.path).output
    drawn = list(draw_plots(found, tmp_path / "plots"))
    assert {path.parent for path in drawn} == {tmp_path / "plots"}
    assert run(record.path).exit_code == 0


def test_number_of_joints_is_limited(tmp_path: Path) -> None:
    assert len(figures(foreign(tmp_path, [(f"j{n}", {}) for n in range(3 * MAX_JOINTS)]))) == MAX_JOINTS
