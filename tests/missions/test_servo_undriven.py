"""Servos that answer and cannot be driven, as users meet them: commands end, with the reason and the fix."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.missions.command import Outcome, command
from tests.missions.servo_bench import Three, patient, three

Run = Callable[[str], Outcome]


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Three]:
    monkeypatch.chdir(tmp_path)
    with three(Path("three.yaml"), patient(monkeypatch)) as found:
        yield found


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    return lambda line: command(capsys, *line.split(), "--robot", "three.yaml")


def test_move_in_a_wrong_operating_mode_suggests_the_fix(robot: Three, run: Run) -> None:
    robot.wrist.set("operating_mode", 1)
    outcome = run("servo move wrist 10 deg")
    assert outcome.code == 1
    assert "wrist cannot be moved" in outcome.out
    assert "mission servo set 3 operating_mode 3" in outcome.out
    assert robot.wrist.limp


@pytest.mark.real_time
def test_recording_with_a_missing_joint_ends_before_joints_go_limp(robot: Three, run: Run) -> None:
    robot.wrist.present = False
    robot.elbow.set("torque_enable", 1)
    outcome = run("servo record shown --seconds 1 --yes")
    assert outcome.code == 3
    assert "wrist cannot be moved: arm: wrist (servo 3) does not answer" in outcome.err
    assert "limp:" not in outcome.err


def test_doctor_suggests_the_fix_for_wrong_angle_limits(robot: Three, run: Run) -> None:
    robot.elbow.set("cw_angle_limit", 0)
    robot.elbow.set("ccw_angle_limit", 0)
    outcome = run("doctor")
    assert "mission servo set 2 ccw_angle_limit 1023 --robot three.yaml" in outcome.out


def test_servo_that_answers_only_pings_can_be_repaired(robot: Three, run: Run) -> None:
    robot.elbow.set("status_return_level", 0)
    outcome = run("servo scan --ids 1-3 --baud 1000000")
    assert "servo 2 replies to a ping, but not to a read" in outcome.err
    assert "mission servo set 2 status_return_level 2" in outcome.err
    assert "mission servo set 2 status_return_level 2" in run("servo info 2").err
    assert "mission servo set 2 status_return_level 2" in run("servo torque on elbow").err
    outcome = run("servo set 2 status_return_level 2")
    assert (outcome.code, "--yes" in outcome.err) == (2, True)
    outcome = run("servo set 2 status_return_level 2 --yes")
    assert outcome.code == 0, outcome.err
    assert robot.elbow.get("status_return_level") == 2


def test_two_servos_with_one_id_are_not_taken_for_one_that_answers_only_pings(robot: Three, run: Run) -> None:
    robot.waist.set("id", 2)
    outcome = run("servo set 2 status_return_level 2 --yes")
    assert outcome.code == 3
    assert "damaged" in outcome.err
    assert run("servo set 2 id 9 --yes").code == 3
    assert [robot.waist.number, robot.elbow.number] == [2, 2]


def test_id_shared_by_both_protocols_is_refused(robot: Three, capsys: pytest.CaptureFixture[str]) -> None:
    robot.wrist.set("id", 1)
    words = ("servo", "set", "1", "id", "9", "--yes", "--port", robot.terminal.path)
    outcome = command(capsys, *words)
    assert outcome.code == 3
    assert "two servos have ID 1: model 12 (protocol 1.0) and model 1060 (protocol 2.0)" in outcome.err
    assert [robot.waist.number, robot.wrist.number] == [1, 1]
