"""A robot with a second pan/tilt: a part under a name of its own, which missions turn by saying ``on``."""

from math import radians
from pathlib import Path

import click
import pytest

from behaviours.robot import ExtraPart, Robot
from config.diagnostics import InvalidFileError, SourceText
from config.library import find_file
from config.robot import RobotConfig
from config.world import load_world
from drivers.api.driver import DriverContext
from drivers.arduino.declared import SecondPanTiltKeys
from drivers.arduino.driver import ArduinoHead, make, make_second
from drivers.clock import ManualClock
from missions.assembly.assembled_robot import AssembledRobot
from missions.assembly.part_factory import Overrides
from missions.executive.events import CommandSent, Event
from missions.library.drivers import load_robot, parse_robot
from missions.plugins.setup.doctor.movement_trials import movement_trials
from missions.plugins.teleop.command import _open_robot as teleop_opened
from missions.plugins.teleop.command import command as teleop
from missions.plugins.testing.recorders import STOP, LeafTestBench, RecordedHead
from missions.request import RunRequest
from missions.runner import Runner
from tests.missions.command import command

HEADED = find_file("robots", "turtlebot2_arm").read_text().replace("robot: turtlebot2_arm", "robot: masted")

MAST = """
lidar_mast:
  kind: head
  driver: arduino_second
  speed: 90 deg/s
  pan: {servo: 2, limits: [-60 deg, 60 deg]}
  tilt: {servo: 3}
"""

BOTH = """
mission: both
tree:
  sequence:
    - parallel:
        - look: {pan: 30 deg}
        - look: {pan: -40 deg, on: lidar_mast}
    - scan: {on: lidar_mast, pan: [-30 deg, 30 deg], rows: 1}
"""


def masted(mast: str = MAST, headed: str = HEADED) -> RobotConfig:
    return parse_robot(SourceText("masted.yaml", headed + mast))


def written(folder: Path, mission: str = BOTH) -> tuple[Path, Path]:
    robot, path = folder / "masted.yaml", folder / "both.yaml"
    robot.write_text(HEADED + MAST)
    path.write_text(mission)
    return path, robot


def faults_of(mast: str, headed: str = HEADED) -> list[str]:
    with pytest.raises(InvalidFileError) as caught:
        masted(mast, headed)
    return [fault.message for fault in caught.value.diagnostics]


def test_section_with_a_kind_is_an_additional_part() -> None:
    robot = masted()
    assert "lidar_mast" in robot.parts
    assert robot.head is robot.sections["head"].keys
    assert isinstance(robot.sections["lidar_mast"].keys, SecondPanTiltKeys)


@pytest.mark.parametrize(
    ("mast", "told"),
    [
        (
            MAST.replace("kind: head", "kind: base"),
            "'kind' cannot be 'base': it is one of head, arm",
        ),
        (MAST.replace("servo: 2", "servo: 1"), "servo 1 is the tilt of the 'head'"),
        (MAST.replace("servo: 2", "servo: 3"), "'pan' and 'tilt' are both on servo 3"),
        (MAST + MAST.replace("lidar_mast", "other"), "servo 2 is the pan of 'lidar_mast'"),
        (
            MAST.replace("arduino_second", "arduino").replace("  speed", "  port: /dev/nano\n  speed"),
            "port /dev/nano is used by 'head' already",
        ),
        (MAST.replace("lidar_mast", "Lidar-Mast"), "invalid part name 'Lidar-Mast'"),
        (MAST.replace("  kind: head\n", ""), "a robot file has no key 'lidar_mast'"),
    ],
)
def test_mistakes_in_a_second_head_are_reported(mast: str, told: str) -> None:
    assert faults_of(mast)[0] == told


def test_second_head_needs_its_board() -> None:
    (told,) = faults_of(MAST, "robot: bare\n")
    assert told.startswith("'driver: arduino_second' needs a 'head' with 'driver: arduino'")


def test_two_heads_share_one_board_under_their_names() -> None:
    config = masted()
    clock = ManualClock()
    head = make(config.sections["head"].keys, DriverContext(clock, "/dev/null", part="head"))
    mast = make_second(
        config.sections["lidar_mast"].keys, DriverContext(clock, needed_parts={"head": head}, part="lidar_mast")
    )
    assert isinstance(mast, ArduinoHead)
    assert isinstance(head, ArduinoHead)
    assert mast.board is head.board
    assert (head.name, mast.name) == ("head", "lidar_mast")
    assert mast.limits.pan == pytest.approx((-radians(60), radians(60)))


def test_leaf_turns_the_named_head(tmp_path: Path) -> None:
    mission, robot = written(tmp_path)
    events: list[Event] = []
    result = Runner(RunRequest(str(mission), robot=str(robot), simulate="fast"), listeners=[events.append]).run()
    looks: dict[str, list[float]] = {}
    for event in events:
        if isinstance(event, CommandSent) and "pan" in event.values:
            looks.setdefault(event.to, []).append(float(str(event.values["pan"])))
    assert result.result == "success"
    assert looks["head"] == pytest.approx([radians(30)] * len(looks["head"]), abs=0.01)
    assert looks["lidar_mast"][0] == pytest.approx(radians(-40), abs=0.01)
    assert max(looks["lidar_mast"]) == pytest.approx(radians(30), abs=0.01)


def test_rerun_of_a_second_head_record_is_identical(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mission, robot = written(tmp_path)
    record = tmp_path / "both.mcap"
    run = command(capsys, "run", str(mission), "--robot", str(robot), "--simulate", "fast", "--record", str(record))
    assert run.code == 0
    again = command(capsys, "record", "rerun", str(record))
    assert again.code == 0
    assert "no difference" in again.out


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("parallel: [{look: {pan: 3 deg, on: lidar_mast}}, {nod: {on: lidar_mast}}]", "can both drive the lidar_mast"),
        ("look: {pan: 3 deg, on: lidar_mats}", "needs a lidar_mats; robot 'masted' has none"),
        (
            "sequence: [{set: {which: lidar_mast}}, {look: {pan: 3 deg, on: '${which}'}}]",
            "which head it means must be known before the mission runs",
        ),
        ("track_face: {on: lidar_mast}", "has no argument 'on'"),
    ],
)
def test_the_checker_knows_which_head_a_leaf_drives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, told: str
) -> None:
    mission, robot = written(tmp_path, f"mission: both\ntree:\n  {line}\n")
    checked = command(capsys, "check", str(mission), "--robot", str(robot))
    assert checked.code == 2
    assert told in checked.out + checked.err


@pytest.mark.real_time
def test_head_commands_take_the_name_of_the_second_head(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, robot = written(tmp_path)
    of_mast = ("--robot", str(robot), "--simulate", "--head", "lidar_mast")
    looked = command(capsys, "head", "look", *of_mast, "--pan", "100")
    assert (looked.code, looked.out) == (0, "looks at +60, +0 deg, the limit for +100, +0 deg\n")
    trimmed = command(capsys, "head", "trim", *of_mast, "--pan", "3", "--keep")
    assert trimmed.code == 0, trimmed.err
    config = load_robot(robot)
    assert config.sections["lidar_mast"].keys.pan.trim == pytest.approx(radians(3))
    assert config.sections["head"].keys == masted().sections["head"].keys


@pytest.mark.parametrize("words", [("head", "center"), ("head", "where"), ("head", "trim", "--pan", "1")])
def test_misspelt_head_gives_a_suggestion(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    _, robot = written(tmp_path)
    told = command(capsys, *words, "--robot", str(robot), "--simulate", "--head", "lidar_mats")
    assert (told.code, "masted has no lidar_mats; --head: did you mean 'lidar_mast'?" in told.err) == (2, True), (
        told.err
    )


@pytest.mark.real_time
def test_teleop_turns_the_named_head(tmp_path: Path) -> None:
    _, robot = written(tmp_path)
    wishes = Overrides(world=load_world(find_file("worlds", "empty")))
    with (
        click.Context(teleop, info_name="teleop"),
        teleop_opened(str(robot), "lidar_mast", wishes, wishes.clock()) as (_, head),
    ):
        assert head is not None
        assert head.limits.pan == pytest.approx((-radians(60), radians(60)))
    with (
        pytest.raises(click.UsageError, match="did you mean 'lidar_mast'"),
        teleop_opened(str(robot), "lidar_mats", wishes, wishes.clock()),
    ):
        pass


def test_doctor_fix_for_a_second_head_names_it() -> None:
    (trial,) = movement_trials("lidar_mast", masted().sections["lidar_mast"])
    assert "mission head trim --robot ROBOT --head lidar_mast" in trial.fix


def test_safe_stop_stops_only_the_named_head() -> None:
    bench = LeafTestBench()
    mast = RecordedHead(bench.clock)
    robot = Robot(head_part=bench.head, extra_parts={"lidar_mast": ExtraPart("head", mast)})
    assembled = AssembledRobot("masted", robot, {"head": bench.head, "lidar_mast": mast})
    assert assembled.moving_parts == ("head", "lidar_mast")
    assembled.safe_stop(frozenset({"lidar_mast"}))
    assert (bench.head.commands, mast.commands) == ([], [STOP])
