"""The ``base`` and ``range`` sections of a robot file: all that they may say, and what is wrong with one."""

from math import radians
from pathlib import Path

import pytest

from config.diagnostics import Diagnostic, InvalidFileError, SourceText
from config.library import find_file, shipped_files
from drivers.api import Reflexes
from drivers.api.steering import BUTTON_COUNT
from drivers.kobuki.declared import KobukiKeys
from drivers.kobuki.virtual import BUTTONS as BUTTONS_OF_A_KOBUKI
from drivers.rplidar.declared import RPLidarKeys
from missions.library.drivers import load_robot, parse_robot

BASE = "robot: r\nbase:\n  driver: kobuki\n  port: /dev/base\n"
RANGE = "robot: r\nrange:\n  driver: rplidar\n  port: /dev/rplidar\n"


def base(*lines: str) -> KobukiKeys:
    found = parse_robot(SourceText("r.yaml", BASE + "".join(f"  {line}\n" for line in lines))).keys(KobukiKeys)
    assert found is not None
    return found


def ranger(*lines: str) -> RPLidarKeys:
    found = parse_robot(SourceText("r.yaml", RANGE + "".join(f"  {line}\n" for line in lines))).keys(RPLidarKeys)
    assert found is not None
    return found


def mistakes(text: str) -> list[Diagnostic]:
    with pytest.raises(InvalidFileError) as caught:
        parse_robot(SourceText("r.yaml", text))
    return list(caught.value.diagnostics)


def told(*lines: str, section: str = BASE) -> list[tuple[int, int, str, str]]:
    found = mistakes(section + "".join(f"  {line}\n" for line in lines))
    return [(fault.mark.line, fault.mark.column, fault.message, fault.suggestion) for fault in found]


# Reflexes


def test_reflexes_default_to_the_usual_ones() -> None:
    assert base().reflexes == Reflexes()
    assert base("reflexes: {}").reflexes == Reflexes()


def test_reflexes_are_read_in_si_units_and_the_battery_in_percent() -> None:
    found = base(
        "reflexes:",
        "  cliff: latch",
        "  wheel_drop: latch",
        "  bumper: stop",
        "  back_off: 8 cm",
        "  back_off_speed: 20 cm/s",
        "  battery_low: 30 %",
        "  battery_critical: 12.5 %",
        "  stop_button: 0",
        "  enable_button: 2",
    ).reflexes
    assert found == Reflexes(
        cliff="latch",
        wheel_drop="latch",
        bumper="stop",
        back_off_distance=0.08,
        back_off_speed=0.2,
        battery_low=30.0,
        battery_critical=12.5,
        stop_button=0,
        enable_button=2,
    )


def test_battery_low_zero_may_have_a_critical_level() -> None:
    found = base("reflexes: {battery_low: 0 %, battery_critical: 10 %}").reflexes
    assert (found.battery_low, found.battery_critical) == (0.0, 10.0)


def test_a_base_has_as_many_buttons_as_files_may_name() -> None:
    assert range(BUTTON_COUNT) == range(len(BUTTONS_OF_A_KOBUKI))


def test_all_reflex_faults_are_reported_together_with_positions() -> None:
    assert told(
        "reflexes:",
        "  cliff: back_off",
        "  bumper: backoff",
        "  back_off: 5",
        "  batery_low: 20 %",
        "  battery_critical: 110 %",
        "  stop_button: 3",
        "  enable_button: green",
    ) == [
        (6, 12, "'cliff' cannot be 'back_off'", "known are: latch, stop"),
        (7, 13, "'bumper' cannot be 'backoff'", "did you mean 'back_off'?"),
        (8, 15, "'back_off' needs a length such as '0.5 m': '5' has no unit (units: m, cm, mm)", ""),
        (9, 5, "'reflexes' has no key 'batery_low'", "did you mean 'battery_low'?"),
        (10, 23, "'battery_critical' must be at most 100 %", ""),
        (11, 18, "'stop_button' must be at most 2", ""),
        (12, 20, "'enable_button' needs a whole number", ""),
    ]


def test_a_cliff_cannot_be_switched_off() -> None:
    ((_, _, message, suggestion),) = told("reflexes: {cliff: off}")
    assert message == "'cliff' cannot be 'off'"
    assert suggestion == "known are: latch, stop"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("reflexes: {stop_button: 1, enable_button: 1}", "button 1 cannot both stop and enable the base"),
        ("reflexes: {battery_low: 5 %}", "'battery_critical' (10 %) is above 'battery_low' (5 %)"),
        ("reflexes: stop", "'reflexes' must be a mapping of keys to values, such as 'name: value'"),
    ],
)
def test_contradictory_reflexes_are_reported(line: str, message: str) -> None:
    assert [found[2] for found in told(line)] == [message]


# The range finder


def test_range_finder_needs_only_driver_and_port() -> None:
    assert ranger() == RPLidarKeys(
        port="/dev/rplidar", model="a1", baud=115_200, position=(0.0, 0.0, 0.2), yaw=0.0, blind=()
    )


def test_range_finder_mounting_and_blind_sectors_are_read_in_si_units() -> None:
    found = ranger(
        "model: a2",
        "baud: 256000",
        "position: [5 cm, -1 cm, 0.3 m]",
        "yaw: 180 deg",
        "blind: [[100 deg, 120 deg], [170 deg, -170 deg]]",
    )
    assert (found.model, found.baud, found.position) == ("a2", 256_000, (0.05, -0.01, 0.3))
    assert found.yaw == pytest.approx(radians(180))
    assert found.blind == tuple((radians(first), radians(second)) for first, second in ((100, 120), (170, -170)))


def test_a_range_finder_is_a_part_of_the_robot() -> None:
    assert parse_robot(SourceText("r.yaml", RANGE)).parts == {"range"}


def test_all_range_finder_faults_are_reported_together_with_positions() -> None:
    assert told(
        "model: A1",
        "position: [1 m, 2 m]",
        "yaw: 180",
        "blind: [[100 deg], 20 deg, [1 deg, 2 m]]",
        "blnd: []",
        section=RANGE.replace("rplidar\n", "rplidr\n", 1),
    ) == [
        (3, 11, "'driver' cannot be 'rplidr'", "did you mean 'rplidar'?"),
        (5, 10, "'model' cannot be 'A1'", "did you mean 'a1'?"),
        (6, 14, "'position' needs three lengths: [x, y, z]", ""),
        (7, 8, "'yaw' needs an angle such as '30 deg': '180' has no unit (units: deg, rad)", ""),
        (8, 11, "'blind' needs pairs of angles, anticlockwise", "blind: [[100 deg, 120 deg]]"),
        (8, 22, "'blind' needs pairs of angles, anticlockwise", "blind: [[100 deg, 120 deg]]"),
        (8, 38, "'blind' needs an angle such as '30 deg', got a length: '2 m'", ""),
        (9, 3, "'range' has no key 'blnd'", "did you mean 'blind'?"),
    ]


# The robots that ship


def test_the_turtlebot_without_an_arm_ships() -> None:
    robot = load_robot(find_file("robots", "turtlebot2"))
    assert robot.parts == {"base", "range", "camera", "voice"}
    assert robot.base is not None
    assert robot.base.max_speed == 0.23
    assert robot.base.reflexes == Reflexes(stop_button=0, enable_button=2)
    finder, base = robot.range, robot.base
    assert isinstance(finder, RPLidarKeys)
    assert isinstance(base, KobukiKeys)
    assert (finder.model, finder.port, base.port) == ("a1", "/dev/rplidar", "/dev/kobuki")


@pytest.mark.parametrize("path", shipped_files("robots").values(), ids=lambda path: path.stem)
def test_shipped_robot_files_load(path: Path) -> None:
    assert load_robot(path).name == path.stem
