"""Robot files: everything that they may say, and everything that is wrong with one, in one go."""

import math
from pathlib import Path

import pytest

from config.diagnostics import Diagnostic, InvalidFileError
from config.robot import RobotConfig
from drivers.arduino.declared import ArduinoKeys
from drivers.kobuki.declared import KobukiKeys
from drivers.servos.declared import DynamixelKeys
from missions.library.drivers import load_robot

WHOLE = """\
robot: r2
summary: A droid.
rate: 50 Hz
base: {driver: kobuki, port: /dev/base, max_speed: 0.3 m/s, max_turn: 90 deg/s}
head:
  driver: arduino
  port: /dev/head
  boot: 500 ms
  pan: {limits: [-80 deg, 80 deg]}
  tilt: {servo: 2, limits: [-60 deg, 20 deg], flip: true, trim: 3 deg}
arm:
  driver: dynamixel
  port: /dev/arm
  at_end: relax
  joints:
    elbow: {id: 6, limits: [0 deg, 130 deg], torque: 60 %}
    wrist: {id: 7, reverse: true, zero: 90 deg}
camera: {source: 0, field_of_view: 60 deg, position: [5 cm, 0 m, 1.1 m]}
voice: {driver: print}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "robot.yaml"


def load(file: Path, text: str) -> RobotConfig:
    file.write_text(text, encoding="utf-8")
    return load_robot(file)


def mistakes(file: Path, text: str) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        load(file, text)
    return list(caught.value.diagnostics)


def test_a_robot_is_read_in_si_units(file: Path) -> None:
    robot = load(file, WHOLE)
    assert (robot.name, robot.summary, robot.rate, robot.path) == ("r2", "A droid.", 50.0, file)
    assert robot.parts == {"base", "head", "arm", "camera", "voice"}
    assert isinstance(robot.base, KobukiKeys)
    assert (robot.base.port, robot.base.baud, robot.base.max_speed) == ("/dev/base", 115_200, 0.3)
    assert robot.base.max_turn == pytest.approx(math.pi / 2)
    assert isinstance(robot.head, ArduinoKeys)
    assert robot.head.boot == 0.5
    assert (robot.head.pan.servo, robot.head.pan.flip, robot.head.tilt.servo, robot.head.tilt.flip) == (
        0,
        False,
        2,
        True,
    )
    assert robot.head.tilt.trim == pytest.approx(math.radians(3))
    assert isinstance(robot.arm, DynamixelKeys)
    assert robot.arm.at_end == "relax"
    assert list(robot.arm.joints) == ["elbow", "wrist"]
    assert robot.arm.joints["elbow"].torque == pytest.approx(0.6)
    assert robot.arm.joints["wrist"].reverse
    assert robot.camera is not None
    assert (robot.camera.source, robot.camera.position) == ("0", (0.05, 0.0, 1.1))
    assert robot.sections["voice"].driver.name == "print"


def test_robot_has_only_the_named_parts(file: Path) -> None:
    robot = load(file, "robot: r2\nvoice: {}\n")
    assert robot.parts == {"voice"}
    assert robot.rate == 20.0
    assert (robot.base, robot.head, robot.arm, robot.camera) == (None, None, None, None)


def test_all_faults_are_reported_together_with_positions(file: Path) -> None:
    faults = mistakes(
        file,
        "robot: r2\n"
        "rat: 20 Hz\n"
        "base: {driver: kobuky, port: /dev/x, max_speed: 2 m/s, baud: fast}\n"
        "head: {driver: arduino, pan: {limits: [80 deg, -80 deg]}, tilt: {limits: 5 deg, flip: 1}}\n"
        "camera: {position: [1 m, 2 m], width: 640.5}\n",
    )
    assert [(fault.mark.line, fault.mark.column, fault.message, fault.suggestion) for fault in faults] == [
        (2, 1, "a robot file has no key 'rat'", "did you mean 'rate'?"),
        (3, 16, "'driver' cannot be 'kobuky'", "did you mean 'kobuki'?"),
        (3, 49, "'max_speed' must be at most 0.7 m/s", ""),
        (3, 62, "'baud' needs a whole number", ""),
        (4, 7, "'head' needs 'port'", "Serial port of the device."),
        (4, 39, "'limits': the first value must be below the second", ""),
        (4, 74, "'limits' needs two values: [low, high]", ""),
        (4, 87, "'flip' needs true or false", ""),
        (5, 21, "'position' needs three lengths: [x, y, z]", ""),
        (5, 39, "'width' needs a whole number", ""),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rate: 20 Hz\n", "a robot file needs 'robot'"),
        ("robot:\n", "'robot' needs a text"),
        ("robot: ''\n", "'robot' needs a text"),
        ("robot: [r2]\n", "'robot' needs a text"),
        ("- r2\n", "a robot file must be a mapping of keys to values, such as 'name: value'"),
        ("robot: r2\nbase:\n", "'base' must be a mapping of keys to values, such as 'name: value'"),
        ("robot: r2\nrate: 20\n", "'rate' needs a frequency such as '20 Hz': '20' has no unit (units: Hz)"),
        ("robot: r2\nrate: 1e999 Hz\n", "'rate' needs a frequency such as '20 Hz': '1e999 Hz' is too large"),
        ("robot: r2\nrate: 0 Hz\n", "'rate' must be at least 1 Hz"),
        ("robot: r2\nrate: {}\n", "'rate' needs a frequency such as '20 Hz', got a mapping"),
        ("robot: r2\nvoice: {driver: }\n", "'driver' cannot be nothing"),
        ("robot: r2\nvoice: {driver: [auto]}\n", "'driver' cannot be a list"),
        ("robot: r2\nrobot: r3\n", "'robot' is a duplicate key (first at line 1)"),
    ],
)
def test_robot_file_fault_names_the_required_value(file: Path, text: str, message: str) -> None:
    assert [fault.message for fault in mistakes(file, text)] == [message]


def test_a_driver_in_the_place_of_a_section_is_shown_within_one(file: Path) -> None:
    (fault,) = mistakes(file, "robot: r2\nbase: kobuki\n")
    assert fault.suggestion == "write base: {driver: kobuki}, with its other keys"
    (fault,) = mistakes(file, "robot: r2\nbase: wheels\n")
    assert fault.suggestion == ""


@pytest.mark.parametrize("baud", ["9" * 5000, "1e999", "-1", "true", "9600.0"])
def test_nonsense_numbers_are_refused_and_not_choked_on(file: Path, baud: str) -> None:
    (fault,) = mistakes(file, f"robot: r2\nbase: {{driver: kobuki, port: x, baud: {baud}}}\n")
    assert fault.message.startswith("'baud' ")


def test_two_joints_cannot_share_an_id(file: Path) -> None:
    text = "robot: r\narm:\n  driver: dynamixel\n  port: x\n  joints:\n    a: {id: 1}\n    b: {id: 2}\n    c: {id: 1}\n"
    (fault,) = mistakes(file, text)
    assert (fault.mark.line, fault.mark.column) == (8, 5)
    assert fault.message == "joint 'c' has id 1, as 'a' has"


def test_missing_ids_are_not_reported_as_duplicates(file: Path) -> None:
    text = "robot: r\narm:\n  driver: dynamixel\n  port: x\n  joints:\n    a: {}\n    b: {}\n    c: {id: 300}\n"
    assert [fault.message for fault in mistakes(file, text)] == [
        "joint 'a' needs 'id'",
        "joint 'b' needs 'id'",
        "'id' must be at most 253",
    ]


def test_both_axes_of_a_head_cannot_be_on_one_servo(file: Path) -> None:
    (fault,) = mistakes(file, "robot: r\nhead: {driver: arduino, port: x, pan: {servo: 1}, tilt: {}}\n")
    assert (fault.mark.line, fault.message) == (2, "'pan' and 'tilt' are both on servo 1")


def test_a_wrong_limit_is_not_called_out_of_order_too(file: Path) -> None:
    text = "robot: r\nhead: {driver: arduino, port: x, pan: {limits: [10 dge, 0 deg]}, tilt: {}}\n"
    (fault,) = mistakes(file, text)
    assert "unknown unit 'dge'" in fault.message


def test_reconnect_times_are_read_from_the_base_section(tmp_path: Path) -> None:
    path = tmp_path / "away.yaml"
    path.write_text("robot: r\nbase:\n  driver: kobuki\n  port: /dev/kobuki\n  away: {decide_after: 500 ms}\n")
    base = load_robot(path).base
    assert base is not None
    assert (base.away.decide_after, base.away.latch_after) == (0.5, 5.0)
    path.write_text(path.read_text().replace("500 ms", "6 s, latch_after: 2 s"))
    with pytest.raises(InvalidFileError, match=r"'latch_after' \(2 s\) is below 'decide_after' \(6 s\)"):
        load_robot(path)
