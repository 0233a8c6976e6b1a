"""``mission servo calibrate`` and ``import``: what was found out, or read elsewhere, stands in the robot file."""

from collections.abc import Callable, Iterator
from math import degrees, radians
from pathlib import Path

import pytest

from config.library import find_file
from config.yaml_edit import NotEditableError
from drivers.servos.declared import DynamixelKeys
from drivers.servos.virtual.servo import VirtualServo
from missions.library.drivers import load_robot
from missions.plugins.setup.servo.ranges import ServoRange, write_ranges
from tests.missions.command import Outcome, command
from tests.missions.servo_bench import Three, by_hand, patient, three

Mission = Callable[[str], Outcome]

TICK = 300 / 1024  # degrees, of an AX-12A


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str]) -> Mission:
    """The command, in one line of words."""
    return lambda line: command(capsys, *line.split())


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Three]:
    monkeypatch.chdir(tmp_path)
    with three(Path("three.yaml"), patient(monkeypatch)) as found:
        yield found


def limits(path: Path, joint: str) -> tuple[float, float]:
    """The limits of a joint in the file, in degrees."""
    arm = load_robot(path).keys(DynamixelKeys)
    assert arm is not None
    return degrees(arm.joints[joint].lower), degrees(arm.joints[joint].upper)


def turned(servo: VirtualServo, *angles: float) -> Iterator[None]:
    """Turn a servo by hand to these angles (degrees from its middle), one after the other."""
    assert servo.limp
    for angle in angles:
        servo.turn_by_hand(radians(angle))
        yield


def test_calibrate_writes_measured_limits_less_a_margin(
    robot: Three, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = robot.path.read_text()
    robot.elbow.set("torque_enable", 1)
    by_hand(monkeypatch, robot.clock, turned(robot.elbow, -60.0, 50.0, 0.0))
    outcome = mission("servo calibrate --robot three.yaml elbow waist --seconds 0.3 --yes")
    assert outcome.code == 0, outcome.err
    # Zero is at 10 deg of the servo, and the joint is reversed: -60..50 deg is -40..70 deg; 2 deg less at either end.
    assert limits(robot.path, "elbow") == pytest.approx((-38.0, 68.0), abs=2 * TICK)
    assert limits(robot.path, "waist") == (-90.0, 90.0)
    assert "hardly moved: unchanged" in outcome.out
    after = robot.path.read_text().splitlines()
    changed = [line for line, was in zip(after, before.splitlines(), strict=True) if line != was]
    assert [line.split(":")[0].strip() for line in changed] == ["elbow"]
    assert Path("three.yaml.bak").read_text() == before
    assert robot.elbow.limp


def test_calibrate_can_set_zero_at_the_first_pose(
    robot: Three, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot.waist.turn_by_hand(radians(20))
    by_hand(monkeypatch, robot.clock, turned(robot.waist, 20.0, 80.0, -40.0))
    outcome = mission("servo calibrate --robot three.yaml waist --zero --margin 0 --seconds 0.3")
    assert outcome.code == 0, outcome.err
    arm = load_robot(robot.path).keys(DynamixelKeys)
    assert arm is not None
    assert degrees(arm.joints["waist"].zero) == pytest.approx(20.0, abs=TICK)
    assert limits(robot.path, "waist") == pytest.approx((-60.0, 60.0), abs=3 * TICK)


def test_calibrate_writes_nothing_without_motion(robot: Three, mission: Mission) -> None:
    before = robot.path.read_text()
    outcome = mission("servo calibrate --robot three.yaml wrist --seconds 0.2")
    assert (outcome.code, robot.path.read_text()) == (1, before)
    assert "no joint was turned: nothing is written" in outcome.err


def test_calibrate_never_writes_a_shipped_robot_file(mission: Mission) -> None:
    outcome = mission("servo calibrate --robot turtlebot2_arm --simulate --seconds 0.2")
    assert outcome.code == 2
    assert "mission servo calibrate --robot my_turtlebot2_arm.yaml" in outcome.err


@pytest.mark.usefixtures("robot")
def test_the_enter_key_needs_a_terminal(mission: Mission) -> None:
    outcome = mission("servo calibrate --robot three.yaml")
    assert outcome.code == 2
    assert "--seconds N" in outcome.err


# The file


def test_ranges_in_ticks_stay_in_ticks_with_numbered_backups(robot: Three) -> None:
    first = robot.path.read_text()
    assert write_ranges(robot.path, {"wrist": ServoRange(1100, 3000, 2000)}).name == "three.yaml.bak"
    assert "ticks: {init: 2000, min: 1100, max: 3000}" in robot.path.read_text()
    second = robot.path.read_text()
    assert write_ranges(robot.path, {"wrist": ServoRange(1200, 2900)}).name == "three.yaml.bak2"
    assert "ticks: {init: 2000, min: 1200, max: 2900}" in robot.path.read_text()
    assert [Path(f"three.yaml.{end}").read_text() for end in ("bak", "bak2")] == [first, second]


def test_robot_file_with_yaml_anchors_is_not_edited(robot: Three) -> None:
    text = robot.path.read_text().replace("limits: [-90 deg, 90 deg]", "limits: &both [-90 deg, 90 deg]")
    robot.path.write_text(text.replace("limits: [-60 deg, 60 deg]", "limits: *both"))
    before = robot.path.read_text()
    with pytest.raises(NotEditableError):
        write_ranges(robot.path, {"waist": ServoRange(400, 600)})
    assert robot.path.read_text() == before
    assert not Path("three.yaml.bak").exists()


# Import

ROS = """\
shoulder_controller:
  controller: {package: dynamixel_controllers, module: joint_position_controller, type: JointPositionController}
  joint_name: shoulder
  joint_speed: 1.5
  motor: {id: 11, init: 512, min: 205, max: 819}
grip_controller:
  controller: {package: dynamixel_controllers, module: joint_position_controller, type: JointPositionController}
  joint_name: grip
  joint_compliance_slope: 32
  motor: {id: 12, init: 400, min: 700, max: 300}
"""


def test_a_ros_file_becomes_a_robot_file_on_stdout(tmp_path: Path, mission: Mission) -> None:
    (tmp_path / "arm.yaml").write_text(ROS)
    outcome = mission(f"servo import {tmp_path}/arm.yaml --port /dev/ttyUSB3")
    assert outcome.code == 0, outcome.err
    assert "'joint_compliance_slope' is left out" in outcome.err
    (tmp_path / "robot.yaml").write_text(outcome.out)
    arm = load_robot(tmp_path / "robot.yaml").keys(DynamixelKeys)
    assert arm is not None
    assert (arm.port, list(arm.joints), arm.joints["grip"].reverse) == ("/dev/ttyUSB3", ["shoulder", "grip"], True)


@pytest.mark.parametrize("model", ["AX-12", "AX-12+"])
def test_servo_import_accepts_model_aliases(tmp_path: Path, mission: Mission, model: str) -> None:
    (tmp_path / "arm.yaml").write_text(ROS)
    outcome = mission(f"servo import {tmp_path}/arm.yaml --model {model}")
    assert outcome.code == 0, outcome.err
    assert "model: AX-12A" in outcome.out


def test_servo_import_adds_joints_without_other_changes(robot: Three, mission: Mission) -> None:
    Path("arm.yaml").write_text(ROS)
    before = robot.path.read_text().splitlines()
    assert mission("servo import arm.yaml --into three.yaml").code == 0
    arm = load_robot(robot.path).keys(DynamixelKeys)
    assert arm is not None
    assert list(arm.joints) == ["shoulder", "grip", "waist", "elbow", "wrist"]
    after = robot.path.read_text().splitlines()
    assert [line for line in after if line in before] == before
    outcome = mission("servo import arm.yaml --into three.yaml")
    assert (outcome.code, "it has shoulder, grip already" in outcome.err) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("arm.yaml -o three.yaml", "three.yaml already exists"),
        ("arm.yaml -o new.yaml --into three.yaml", "-o and --into cannot be used together"),
        ("arm.yaml --model AX-12B", "did you mean 'AX-12"),
        (f"arm.yaml --into {find_file('robots', 'turtlebot2_arm')}", "ships with MissionTree"),
        ("three.yaml", "three.yaml is a robot: "),
    ],
)
def test_servo_import_refuses_wrong_arguments(robot: Three, mission: Mission, arguments: str, words: str) -> None:
    Path("arm.yaml").write_text(ROS)
    before = robot.path.read_text()
    outcome = mission(f"servo import {arguments}")
    assert (outcome.code, words in outcome.err) == (2, True), outcome.err
    assert robot.path.read_text() == before
