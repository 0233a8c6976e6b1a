"""``mission servo`` on Feetech servos: what it shows of them, and what their protocol has not."""

from collections.abc import Callable

import pytest

from tests.missions.command import Outcome, command

Mission = Callable[[str], Outcome]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str]) -> Mission:
    return lambda line: command(capsys, *line.split())


@pytest.mark.parametrize("protocol", ["", "--protocol sts"])
def test_scan_finds_feetech_servos(mission: Mission, protocol: str) -> None:
    outcome = mission(f"servo scan --robot so101 --simulate --ids 1-7 {protocol}")
    assert outcome.code == 0, outcome.err
    rows = [line.split() for line in outcome.out.splitlines()]
    assert [row[:5] for row in rows[1:]] == [[str(n), "STS", "1000000", "STS3215", "3.10"] for n in range(1, 7)]
    assert rows[3][-2:] == ["elbow_flex", "none"]


def test_scan_for_dynamixel_finds_no_feetech_servos(mission: Mission) -> None:
    outcome = mission("servo scan --robot so101 --simulate --ids 1-2 --protocol 1")
    assert outcome.code == 1
    assert "no servo replies" in outcome.err


def test_servo_info_shows_registers_with_units(mission: Mission) -> None:
    outcome = mission("servo info elbow_flex --robot so101 --simulate")
    assert "servo 3: STS3215, the STS protocol" in outcome.out
    meant = {line.split()[1]: line.split()[2:] for line in outcome.out.splitlines()[3:]}
    assert meant["firmware"][:2] == ["2563", "3.10"]
    assert meant["baud"][:3] == ["0", "1000000", "baud"]
    assert meant["max_position"][:3] == ["4095", "+179.9", "deg"]
    assert meant["position_offset"][:5] == ["0", "0.0", "deg", "wide", "EEPROM"]
    assert meant["present_voltage"][:3] == ["74", "7.4", "V"]


def test_dangerous_feetech_settings_are_refused(mission: Mission) -> None:
    for told, words in (
        ("torque_enable 128", "torque_enable takes 0..1, not 128"),
        ("goal_speed 0", "goal_speed 0 means full speed"),
        ("response_level 0", "is not driven"),
    ):
        outcome = mission(f"servo set elbow_flex {told} --robot so101 --simulate --yes")
        assert outcome.code != 0
        assert words in outcome.err
    assert "the STS protocol has no restart" in mission("servo torque restart elbow_flex --robot so101 --simulate").err
    assert mission("servo set elbow_flex baud 76800 --robot so101 --simulate --yes").code == 0
    assert (
        "no servo of the STS protocol can run at 9600" in mission("servo set 3 baud 9600 --robot so101 --simulate").err
    )


def test_koch_arm_moves_two_kinds_of_servos(mission: Mission) -> None:
    outcome = mission("servo move gripper 20 deg --robot koch --simulate")
    assert outcome.code == 0, outcome.err
    assert "gripper is at +" in outcome.out
