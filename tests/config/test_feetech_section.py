"""The arm of Feetech servos in a robot file, and the calibration file of LeRobot's that it may name."""

import json
from math import degrees, radians
from pathlib import Path
from typing import Any

import pytest

from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from drivers.servos.calibration import format_calibration, load_calibration
from drivers.servos.feetech import FeetechKeys
from drivers.servos.make import joint_specs as specs
from missions.library.drivers import parse_robot
from tests.cases import each

ELBOW = {"id": 3, "drive_mode": 0, "homing_offset": -1024, "range_min": 1000, "range_max": 3000}
JAW = {"id": 6, "drive_mode": 0, "homing_offset": 10, "range_min": 2000, "range_max": 3500}


def arm_of(calibration: Path | None, elbow: str = "id: 3") -> FeetechKeys:
    named = "" if calibration is None else f"  calibration: {calibration}\n"
    joints = f"    elbow: {{{elbow}}}\n    jaw: {{id: 6, zero_at: lowest}}\n"
    found = parse_robot(
        SourceText("robot.yaml", f"robot: r\narm:\n  driver: feetech\n  port: x\n{named}  joints:\n{joints}")
    )
    arm = found.keys(FeetechKeys)
    assert arm is not None
    return arm


def faults_of(calibration: Path) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        arm_of(calibration)
    return list(caught.value.diagnostics)


def written(folder: Path, **motors: object) -> Path:
    path = folder / "so101.json"
    path.write_text(json.dumps({"elbow": ELBOW, "jaw": JAW} | motors))
    return path


def test_joint_without_calibration_uses_the_robot_file() -> None:
    elbow = arm_of(None, "id: 3, limits: [-90 deg, 80 deg]").servos["elbow"]
    assert (elbow.model, elbow.zero) == ("STS3215", 0.0)
    assert degrees(elbow.upper) == pytest.approx(80)


def test_calibration_file_sets_zero_limits_and_offset(tmp_path: Path) -> None:
    arm = arm_of(written(tmp_path))
    elbow, jaw = arm.servos["elbow"], arm.servos["jaw"]
    tick = elbow.servo_model.tick
    assert elbow.zero == pytest.approx((2000 - 2048) * tick)
    assert (elbow.lower, elbow.upper) == pytest.approx((-1000 * tick, 1000 * tick))
    assert (jaw.lower, jaw.upper) == pytest.approx((0.0, 1500 * tick))
    assert arm.offsets == {"elbow": -1024, "jaw": 10}
    assert {name: spec.offset for name, spec in specs(arm).items()} == arm.offsets
    assert not any(spec.errors() for spec in specs(arm).values())


def test_drive_mode_1_turns_the_joint_round(tmp_path: Path) -> None:
    arm = arm_of(written(tmp_path, jaw=JAW | {"drive_mode": 1}))
    jaw = arm.servos["jaw"]
    assert jaw.reverse
    assert (jaw.lower, jaw.upper) == pytest.approx((0.0, 1500 * jaw.servo_model.tick))
    assert jaw.zero == pytest.approx((3500 - 2048) * jaw.servo_model.tick)


def test_robot_file_overrides_the_calibration(tmp_path: Path) -> None:
    elbow = arm_of(written(tmp_path), "id: 3, limits: [-10 deg, 10 deg], zero: 5 deg").servos["elbow"]
    assert (elbow.zero, elbow.upper) == pytest.approx((radians(5), radians(10)))


@each(
    ("told", "words"),
    [
        ({"homing_offset": None}, "motor 'elbow': 'homing_offset' must be a whole number from -2047 to 2047, not None"),
        ({"range_max": 5000}, "motor 'elbow': 'range_max' must be a whole number from 0 to 4095, not 5000"),
        ({"range_min": "7"}, "motor 'elbow': 'range_min' must be a whole number from 0 to 4095, not '7'"),
        ({"drive_mode": True}, "motor 'elbow': 'drive_mode' must be a whole number from 0 to 1, not True"),
        ({"range_min": 3000}, "motor 'elbow': 'range_min' 3000 must be below 'range_max' 3000"),
        ({"id": 4}, "motor 'elbow': 'id' is 4, and joint 'elbow' has 3"),
    ],
)
def test_invalid_calibration_field_is_reported_with_motor_and_value(
    tmp_path_factory: pytest.TempPathFactory, told: dict[str, Any], words: str
) -> None:
    (fault,) = faults_of(written(tmp_path_factory.mktemp("c"), elbow=ELBOW | told))
    assert words in fault.message
    assert fault.mark.line in (5, 7)


def test_all_calibration_faults_are_reported_together(tmp_path: Path) -> None:
    lacking = {key: value for key, value in ELBOW.items() if key != "range_max"}
    (fault,) = faults_of(written(tmp_path, elbow=lacking, jaw=7))
    assert "motor 'elbow' lacks 'range_max'" in fault.message
    assert "motor 'jaw' needs id, drive_mode, homing_offset, range_min, range_max, not 7" in fault.message


@pytest.mark.parametrize("held", ["[" * 100_000, '{"a":' * 100_000, "9" * 100_000])
def test_nested_brackets_and_endless_numbers_are_invalid_json(tmp_path: Path, held: str) -> None:
    path = tmp_path / "so101.json"
    path.write_text(held)
    (fault,) = faults_of(path)
    assert "invalid JSON" in fault.message


def test_duplicate_motor_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "so101.json"
    path.write_text(f'{{"jaw": {json.dumps(JAW)}, "jaw": {json.dumps(JAW)}}}')
    (fault,) = faults_of(path)
    assert "duplicate key 'jaw'" in fault.message


def test_a_pipe_or_an_endless_device_is_no_calibration_and_is_not_waited_for() -> None:
    (fault,) = faults_of(Path("/dev/zero"))
    assert "calibration /dev/zero" in fault.message


def test_missing_motor_invalid_file_and_missing_file_are_reported(tmp_path: Path) -> None:
    path = tmp_path / "so101.json"
    path.write_text(json.dumps({"elbow_flex": ELBOW, "jaw": JAW}))
    assert f"calibration {path} has no motor 'elbow'" in faults_of(path)[0].message
    path.write_text("{")
    assert "invalid JSON" in faults_of(path)[0].message
    path.unlink()
    (fault,) = faults_of(path)
    assert "No such file" in fault.message
    assert "name the file as `ls` shows it" in fault.suggestion


def test_calibration_round_trips(tmp_path: Path) -> None:
    path = written(tmp_path)
    assert json.loads(format_calibration(load_calibration(str(path)))) == {"elbow": ELBOW, "jaw": JAW}


def test_a_dynamixel_is_no_feetech_and_the_other_way_round() -> None:
    for driver, model in (("feetech", "AX-12A"), ("dynamixel", "STS3215")):
        with pytest.raises(InvalidFileError, match="model"):
            parse_robot(
                SourceText(
                    "robot.yaml",
                    f"robot: r\narm: {{driver: {driver}, port: x, joints: {{elbow: {{id: 1, model: {model}}}}}}}\n",
                )
            )
