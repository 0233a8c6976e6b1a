"""Servos that answer and cannot be driven: each is told with the reason, and with the command that helps."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.servos.joint import JointSpec
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from tests.drivers.arms import Make, making

Spoil = Callable[[VirtualServo], object]


@pytest.fixture
def make() -> Iterator[Make]:
    with making() as build:
        yield build


def setting(**values: int) -> Spoil:
    def spoil(servo: VirtualServo) -> None:
        for name, value in values.items():
            servo.set(name, value)

    return spoil


CASES = [
    ("XL430-W250", setting(operating_mode=1), "operating mode 1, not 3", "servo set 2 operating_mode 3"),
    ("XL430-W250", setting(operating_mode=4), "operating mode 4, not 3", "servo set 2 operating_mode 3"),
    ("XL430-W250", setting(operating_mode=16), "operating mode 16, not 3", "servo set 2 operating_mode 3"),
    ("XL430-W250", setting(drive_mode=1), "drive mode 1, not 0", "servo set 2 drive_mode 0"),
    ("XL430-W250", setting(homing_offset=99), "homing offset 99, not 0", "another program has calibrated it"),
    ("XL430-W250", setting(pwm_limit=0), "no force (pwm limit 0)", "servo set 2 pwm_limit 885"),
    ("XL430-W250", setting(min_position=2000), "angle limits of 2000..4095", "write limits: [-4 deg, 179 deg]"),
    ("XL430-W250", setting(status_return_level=1), "status return level 1, not 2", "set 2 status_return_level 2"),
    ("XL430-W250", setting(status_return_level=0), "status return level is 0", "set 2 status_return_level 2"),
    ("AX-12A", setting(cw_angle_limit=0, ccw_angle_limit=0), "in wheel mode", "servo set 2 ccw_angle_limit 1023"),
    ("AX-12A", setting(status_return_level=1), "status return level 1, not 2", "set 2 status_return_level 2"),
    ("AX-12A", setting(status_return_level=0), "status return level is 0", "set 2 status_return_level 2"),
    ("AX-12A", setting(max_torque=0), "no force (max torque 0)", "servo set 2 max_torque 1023"),
    ("AX-12A", setting(model_number=300), "is model 300 (AX-12W), not 12", "write model: AX-12W"),
    ("AX-12A", setting(model_number=999), "is model 999 (unknown), not 12", "servo scan --ids 2"),
    ("STS3215", setting(mode=1), "mode 1, not 0", "servo set 2 mode 0"),
    ("STS3215", setting(mode=3), "mode 3, not 0", "servo set 2 mode 0"),
    ("STS3215", setting(response_level=0), "response level 0, not 1", "servo set 2 response_level 1"),
    ("STS3215", setting(min_position=0, max_position=0), "multi-turn mode", "servo set 2 max_position 4095"),
    ("STS3215", setting(min_position=1500), "angle limits of 1500..4095", "calibration"),
    ("STS3215", setting(max_torque=0), "no force (max torque 0)", "servo set 2 max_torque 1000"),
    ("STS3215", lambda servo: setattr(servo, "present", False), "does not answer", "servo scan"),
]


@pytest.mark.parametrize(("name", "spoil", "words", "fix"), CASES)
def test_undriven_servo_is_reported_with_a_hint(make: Make, name: str, spoil: Spoil, words: str, fix: str) -> None:
    good, bad = VirtualServo(1, model=name), VirtualServo(2, model=name)
    spoil(bad)
    specs = {"good": JointSpec(1, name, lower=-1.0, upper=1.0), "bad": JointSpec(2, name, lower=-1.0, upper=1.0)}
    chain = VirtualServoBus([good, bad])
    before = bytes(bad.table[:24])
    arm = make(specs, servos=chain).start()
    health = arm.joints.health()
    assert words in health.detail
    assert "bad (servo 2)" in health.detail
    assert fix in health.hint
    assert bytes(bad.table[:24]) == before
    assert bad.limp


@pytest.mark.parametrize(
    "spoil",
    [setting(operating_mode=4, homing_offset=-1023), setting(operating_mode=5, homing_offset=512, drive_mode=1)],
)
def test_dynamixel_calibrated_by_lerobot_is_not_changed(make: Make, spoil: Spoil) -> None:
    servo = VirtualServo(2, model="XL430-W250")
    spoil(servo)
    arm = make({"elbow": JointSpec(2, "XL430-W250", lower=-1.0, upper=1.0)}, servos=VirtualServoBus([servo])).start()
    assert "another program has calibrated it, LeRobot perhaps" in arm.joints.health().hint
    assert "servo set" not in arm.joints.health().hint
    assert servo.limp


def test_the_file_of_lerobot_is_named_for_a_dynamixel_too(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HF_LEROBOT_CALIBRATION", str(tmp_path))
    file = tmp_path / "robots/koch_follower/mine.json"
    file.parent.mkdir(parents=True)
    motor = {"id": 2, "drive_mode": 0, "homing_offset": -3023, "range_min": 800, "range_max": 3200}
    file.write_text(json.dumps({"elbow_flex": motor}))
    (file.parent / "damaged.json").write_text("{")
    (file.parent / "list.json").write_text("[1]")
    servo = VirtualServo(2, model="XL430-W250")
    setting(operating_mode=4, homing_offset=-3023, min_position=800, max_position=3200)(servo)
    arm = make({"elbow": JointSpec(2, "XL430-W250", lower=-1.0, upper=1.0)}, servos=VirtualServoBus([servo])).start()
    assert f"LeRobot has calibrated it ({file})" in arm.joints.health().hint


def test_servos_with_duplicate_ids_are_not_driven_until_unplugged(make: Make) -> None:
    one, other = VirtualServo(1, angle=0.2), VirtualServo(1, angle=0.7)
    arm = make({"elbow": JointSpec(1), "wrist": JointSpec(2)}, servos=VirtualServoBus([one, other, VirtualServo(2)]))
    arm.start()
    assert "shares its ID with another servo" in arm.joints.health().detail
    assert "set 1 id NEW" in arm.joints.health().hint
    arm.joints.move({"elbow": 0.0, "wrist": 0.3})
    arm.until(lambda: arm.at("wrist", 0.3))
    assert one.limp
    assert other.limp
    other.present = False
    arm.until(lambda: not arm.joints.health().detail)
    arm.joints.move({"elbow": 0.0})
    arm.until(lambda: arm.at("elbow", 0.0))


def test_damaged_replies_are_reported_as_duplicate_ids(make: Make) -> None:
    servos = VirtualServoBus([VirtualServo(1), VirtualServo(1, model="AX-18A"), VirtualServo(2)])
    arm = make({"elbow": JointSpec(1), "wrist": JointSpec(2)}, servos=servos).start()
    assert "sends damaged replies: it shares its ID" in arm.joints.health().detail
