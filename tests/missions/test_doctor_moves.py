"""``mission doctor --move``: what is asked of a person, what moves and how little, and what came of it."""

import math
import re
from collections.abc import Iterator
from contextlib import closing
from io import StringIO
from pathlib import Path

import pytest

from behaviours.leaf import FAILURE, SUCCESS
from drivers.servos.make import VIRTUAL_REPLY_TIMEOUT
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal
from missions.library.drivers import load_robot
from missions.plugins.setup.checkup import PartFinding
from missions.plugins.setup.doctor.movement_trials import TRAVEL, Nudge, movement_trials, try_movements
from missions.plugins.testing.recorders import LeafTestBench
from tests.behaviours.servo_arm import moves, play, with_servos
from tests.missions.command import command

ROBOT = """robot: kit
arm:
  driver: dynamixel
  port: /dev/u2d2
  joints: {shoulder: {id: 1, limits: [-90 deg, 90 deg]}, elbow: {id: 2, limits: [-90 deg, 90 deg]}}
"""


def nudged(bench: LeafTestBench) -> Nudge:
    return bench.put(Nudge("nudge"), joint="elbow")


def test_a_joint_goes_a_little_way_and_back_and_no_other_moves() -> None:
    bench, servos = with_servos()
    leaf = nudged(bench)
    play(bench, leaf)
    assert leaf.status is SUCCESS
    told = [move["elbow"] for move in moves(servos)]
    assert all(set(move) == {"elbow"} for move in moves(servos))
    assert max(told) == pytest.approx(TRAVEL, abs=math.radians(0.2))
    assert told[-1] == pytest.approx(0.0, abs=1e-6)
    assert max(speed["elbow"] for speed in servos.speeds) < math.radians(30)


def test_doctor_does_not_move_a_joint_outside_its_limits() -> None:
    bench, servos = with_servos()
    servos.turn_by_hand("elbow", -0.3)
    leaf = nudged(bench)
    play(bench, leaf)
    assert leaf.status is FAILURE
    assert "it stands at -17 deg; its limits are 0 to" in leaf.reason
    assert not moves(servos)


def test_stuck_joint_fails_the_doctor_trial() -> None:
    bench, servos = with_servos()
    servos.stuck.add("elbow")
    leaf = nudged(bench)
    play(bench, leaf)
    assert leaf.status is FAILURE
    assert leaf.reason == "commanded 4 deg, moved 0.0"


def test_movement_trials_cover_every_moving_part() -> None:
    config = load_robot(Path("config/robots/turtlebot2_arm.yaml").absolute())
    told = {
        part: [trial.about for trial in movement_trials(part, section)] for part, section in config.sections.items()
    }
    assert told["base"] == ["moving"]
    assert told["head"] == ["looking"]
    assert told["arm"] == list(config.arm.limits if config.arm else ())
    assert told["voice"] == ["speaking"]
    assert told["camera"] == []
    (mast,) = movement_trials("lidar_mast", config.sections["head"])
    assert all("on: lidar_mast" in step for step in mast.steps)


@pytest.fixture
def plugged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[PseudoTerminal]:
    """An arm of two servos, and its robot file in this folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("drivers.servos.make.REPLY_TIMEOUT", VIRTUAL_REPLY_TIMEOUT)  # it shares this processor
    Path("kit.yaml").write_text(ROBOT)
    servos = VirtualServoBus([VirtualServo(1), VirtualServo(2)])
    clock = PatientClock()
    monkeypatch.setattr("missions.assembly.part_factory.SystemClock", lambda: clock)
    with closing(PseudoTerminal("u2d2", servos, clock)) as terminal:
        terminal.open()
        yield terminal


def _tried(
    plugged: PseudoTerminal, *answers: bool, unwell: frozenset[str] = frozenset()
) -> tuple[list[PartFinding], list[str]]:
    """Try the arm with a person who answers so; return what was found, and what was asked."""
    asked, left = list[str](), list(answers)

    def ask(question: str) -> bool:
        asked.append(question)
        return left.pop(0)

    config = load_robot(Path("kit.yaml").absolute())
    return list(try_movements(config, "kit.yaml", {"arm": plugged.path}, faulty_parts=unwell, ask=ask)), asked


def test_each_joint_is_moved_with_consent_and_confirmed(plugged: PseudoTerminal) -> None:
    found, asked = _tried(plugged, True, True, True, False)
    assert [(each.finding.about, each.finding.verdict, each.finding.message) for each in found] == [
        ("shoulder", "ok", "done, and confirmed"),
        ("elbow", "wrong", "the motion did not match the command"),
    ]
    assert asked == [
        "arm: shoulder goes 4 degrees to one side, and back; the arm is switched on. Continue?",
        "Did shoulder move, and nothing else?",
        "arm: elbow goes 4 degrees to one side, and back; the arm is switched on. Continue?",
        "Did elbow move, and nothing else?",
    ]
    assert found[1].finding.fix.startswith("mission servo scan --robot kit.yaml")


def test_refused_or_faulty_part_does_not_move(plugged: PseudoTerminal) -> None:
    found, asked = _tried(plugged, False, False)
    assert [each.finding.message for each in found] == ["not tried", "not tried"]
    assert len(asked) == 2
    found, asked = _tried(plugged, unwell=frozenset({"arm"}))
    assert [each.finding.verdict for each in found] == ["warning", "warning"]
    assert not asked


def test_without_a_robot_nothing_can_be_moved(capsys: pytest.CaptureFixture[str]) -> None:
    outcome = command(capsys, "doctor", "--move")
    assert outcome.code == 2
    assert "try: mission doctor --move --robot NAME" in outcome.err


def test_doctor_without_answers_moves_nothing_and_reports_the_rest(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file, port = tmp_path / "kit.yaml", tmp_path / "port"
    file.write_text(ROBOT)
    port.write_text("a file, and no port")
    monkeypatch.setattr("sys.stdin", StringIO())
    told = command(capsys, "doctor", "--move", "--robot", str(file), "--port", f"arm={port}")
    assert "no answer: nothing moves\n" in told.err
    assert told.out.count(f"{port}: ") == 1
    assert re.search(r"\n\d+ wrong, (1 warning|(0|[2-9]) warnings), \d+ ok\n$", told.out)
