"""``mission robot``: which robot is this computer's, what it is made of, and whether it is as its file says."""

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import click
import pytest

from config.defaults import config_folder, load_defaults
from config.library import find_file
from drivers.kobuki.virtual import VirtualKobuki
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal, WireDevice
from missions.cli.names import names_of
from tests.drivers.desks import RecordedMachine
from tests.missions.command import Outcome, command

Mission = Callable[..., Outcome]


@pytest.fixture
def mission(capsys: pytest.CaptureFixture[str]) -> Mission:
    return lambda *arguments: command(capsys, *arguments)


@pytest.fixture
def desk(tmp_path: Path) -> RecordedMachine:
    return RecordedMachine(tmp_path / "machine")


def test_robot_use_sets_the_default_robot(mission: Mission) -> None:
    assert mission("robot", "show").code == 2
    told = mission("robot", "use", "humanoid")
    assert told.code == 0
    assert "humanoid is this computer's robot now" in told.out
    assert "next: mission run greet --robot mine" in told.out
    assert load_defaults().robot == "humanoid"
    shown = mission("robot", "show").out
    assert shown.startswith("humanoid  ")
    assert "arm: dynamixel" in shown


def test_robot_use_stores_the_absolute_path_of_a_file(
    mission: Mission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "kit.yaml").write_text(
        find_file("robots", "humanoid").read_text().replace("robot: humanoid", "robot: kit", 1)
    )
    monkeypatch.chdir(tmp_path)
    assert mission("robot", "use", "kit.yaml").code == 0
    monkeypatch.chdir("/")
    assert mission("robot", "show").out.startswith(f"kit  {tmp_path}/kit.yaml")


def test_a_computer_can_have_no_robot_again(mission: Mission) -> None:
    assert mission("robot", "use", "--none").out == "no default robot is set on this computer\n"
    mission("robot", "use", "humanoid")
    told = mission("robot", "use", "--none")
    assert (told.code, told.out) == (
        0,
        f"humanoid is no longer this computer's robot: {config_folder()}/defaults.yaml\n",
    )
    assert load_defaults().robot == ""
    assert "no default robot is set on this computer" in mission("robot", "show").err
    assert mission("robot", "use", "--none", "humanoid").code == 2
    assert mission("robot", "use").code == 2


def test_missing_default_robot_can_be_removed(mission: Mission) -> None:
    file = config_folder() / "defaults.yaml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("robot: nobody\nrecord: false\n")
    assert "none with `mission robot use --none`" in mission("robot", "show").err
    assert mission("robot", "use", "--none").code == 0
    assert file.read_text() == "record: false\n"


def test_default_robot_in_flow_style_is_not_edited(mission: Mission) -> None:
    file = config_folder() / "defaults.yaml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("{robot: humanoid, record: false}\n")
    told = mission("robot", "use", "--none")
    assert (told.code, "remove it by hand" in told.err) == (2, True)
    assert load_defaults().robot == "humanoid"


NOTE = "the robot is 'so101', this computer's own by {0}/defaults.yaml: --robot NAME selects another"


def test_error_about_the_own_robot_names_the_defaults_file(mission: Mission) -> None:
    mission("robot", "use", "so101")
    note = NOTE.format(config_folder())
    for line in ("run square_3m --simulate fast", "run wave --robot mine --no-record", "robot check --root /nowhere"):
        told = mission(*line.split())
        assert told.code != 0
        if "--root" not in line:
            assert note in told.err, line
            assert "`mission robot use --none` removes it" in told.err, line
    assert "the robot is" not in mission("run", "square_3m", "--simulate", "fast", "--robot", "so101").err


def test_all_commands_simulate_this_computers_own_robot(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "dance.yaml").write_text("mission: dance\ntree:\n  gesture: arm_wave\n")
    (tmp_path / "dance.test.yaml").write_text("tests: dance\ncases:\n  - {case: it waves, expect: {result: success}}\n")
    dance, tests = str(tmp_path / "dance.yaml"), str(tmp_path / "dance.test.yaml")
    lines = (
        ("run", dance, "--simulate", "fast"),
        ("check", dance),
        ("verify", dance),
        ("test", "-j", "1", tests),
        ("sweep", dance, "--runs", "1", "--jobs", "1", "--output", str(tmp_path / "sweep")),
    )
    assert {line[0]: mission(*line).code for line in lines} == dict.fromkeys(
        ("run", "check", "verify", "test", "sweep"), 2
    )
    mission("robot", "use", "so101")
    assert {line[0]: mission(*line).code for line in lines} == dict.fromkeys(
        ("run", "check", "verify", "test", "sweep"), 0
    )
    assert mission("test", "-j", "1", "greet", "-k", "told to say").code == 0, "tests that ship keep their robot"


def test_missing_own_robot_is_reported_once_by_every_command(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "still.yaml").write_text("mission: still\ntree: succeed\n")
    still = str(tmp_path / "still.yaml")
    mission("robot", "use", "so101")
    file = config_folder() / "defaults.yaml"
    file.write_text(file.read_text().replace("so101", "gone"))
    for line in (("run", still), ("check", still), ("sweep", still), ("robot", "show"), ("robot", "check")):
        told = mission(*line)
        assert (told.code, told.err.count("robot use --none")) == (2, 1), line


def test_error_about_the_default_robot_names_it(mission: Mission) -> None:
    line = ("servo", "move", "tentacle", "10 deg")
    told = mission(*line)
    assert "the robot is 'turtlebot2_arm', the default: --robot NAME selects another" in told.err
    assert "the robot is" not in mission(*line, "--robot", "so101", "--simulate").err


def test_unrelated_error_does_not_mention_the_default_robot(mission: Mission, tmp_path: Path) -> None:
    (tmp_path / "wrong.yaml").write_text("mission: wrong\ntree:\n  wait: 1\n")
    mission("robot", "use", "turtlebot2")
    assert "this computer's own" not in mission("run", str(tmp_path / "wrong.yaml")).err


def test_the_demo_names_its_robot() -> None:
    makefile = Path(__file__).parents[2] / "Makefile"
    (line,) = [each for each in makefile.read_text().splitlines() if "mission run greet" in each]
    assert "--simulate --robot turtlebot2_arm" in line


def test_invalid_robot_file_is_not_set_as_default(mission: Mission, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("robot: wrong\nbase: {driver: kobuki}\n")
    told = mission("robot", "use", str(wrong))
    assert told.code == 2
    assert "needs 'port'" in told.err
    assert load_defaults().robot == ""


def test_robot_mine_uses_the_default_robot(mission: Mission) -> None:
    assert "mission robot use NAME" in mission("run", "greet", "--robot", "mine").err
    mission("robot", "use", "turtlebot2_arm")
    told = mission("run", "greet", "--robot", "mine", "--port", "base=/dev/null", "--no-record")
    assert told.code == 3
    assert "base: /dev/null: not a serial port" in told.err


def test_simulation_uses_the_own_robot_by_default(mission: Mission) -> None:
    mission("robot", "use", "so101")
    told = mission("run", "square_3m", "--simulate", "fast")
    assert told.code == 2
    assert "base" in told.err


@pytest.fixture
def plugged(desk: RecordedMachine, monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, PseudoTerminal]]:
    """A Kobuki, and a chain that lacks two of the arm's ten servos."""
    devices: dict[str, WireDevice] = {
        "kobuki": VirtualKobuki(),
        "u2d2": VirtualServoBus([VirtualServo(number) for number in range(1, 9)]),
    }
    clock = PatientClock()
    monkeypatch.setattr(
        sys.modules["missions.plugins.setup.robot.check"], "SystemClock", lambda: clock
    )  # a command hides it
    terminals = {name: PseudoTerminal(name, device, clock) for name, device in devices.items()}
    for number, (name, terminal) in enumerate(terminals.items()):
        terminal.open()
        ids, serial = ("0403:6001", "kobuki_7") if name == "kobuki" else ("0403:6014", "FT7")
        desk.port(f"ttyUSB{number}", ids, serial=serial, behind=terminal.path, rule=name)
    yield terminals
    for terminal in terminals.values():
        with closing(terminal):
            pass


@pytest.mark.usefixtures("plugged")
def test_robot_check_compares_each_part_with_its_device(mission: Mission, desk: RecordedMachine) -> None:
    told = mission("robot", "check", "turtlebot2_arm", "--root", str(desk.root))
    assert told.code == 1
    lines = told.out.splitlines()
    assert "ok       base reports: 50 a second" in lines
    assert "ok       arm waist_turn (servo 1): AX-12A, firmware 24, 12.0 V, 35 degC" in lines
    assert "wrong    arm wrist_roll (servo 9): does not answer" in lines
    assert "wrong    head port: no device at /dev/nano" in lines
    assert "         try: mission ports  (lists the ports and their names)" in lines


def test_robot_check_reports_faults_and_exits_with_1(mission: Mission, desk: RecordedMachine) -> None:
    told = mission("robot", "check", "turtlebot2", "--root", str(desk.root))
    assert told.code == 1
    assert "wrong    base port: no device at /dev/kobuki\n         try: mission ports" in told.out


def test_own_robots_are_listed_and_completed_beside_a_broken_file(mission: Mission) -> None:
    folder = config_folder() / "robots"
    folder.mkdir(parents=True)
    (folder / "kit.yaml").write_text("robot: kit\nsummary: A kit.\n")
    (folder / "wrong.yaml").write_text("robt: wrong\n")
    assert mission("robot", "use", "kit").code == 0
    listed = mission("list", "robots").out
    assert re.search(r"kit +A kit\. \(.*/robots/kit\.yaml\)", listed)
    assert re.search(r"wrong +has \d errors", listed)
    names = names_of("robots", click.Context(click.Command("run")))
    assert {"kit", "wrong", "mine", "turtlebot2"} <= set(names)


def test_wrong_default_and_missing_folders_are_reported_with_the_file(mission: Mission, tmp_path: Path) -> None:
    file = config_folder() / "defaults.yaml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"robot: nobody\nfolders: [{tmp_path}, {tmp_path}/gone]\n")
    wrong = mission("robot", "show")
    assert (wrong.code, wrong.err.startswith(f"mission: {file}: 'robot': unknown robot 'nobody'")) == (2, True)
    assert "set another with `mission robot use NAME`" in wrong.err
    unknown = mission("robot", "show", "somebody")
    assert f"{file} names missing folders: {tmp_path}/gone\n" in unknown.err


def test_the_axes_of_each_head_are_shown_with_their_trims(mission: Mission, tmp_path: Path) -> None:
    file = tmp_path / "two.yaml"
    head = "{driver: arduino, port: /dev/nano, pan: {trim: 4 deg, limits: [-80 deg, 80 deg]}, tilt: {}}"
    mast = "{kind: head, driver: arduino_second, pan: {servo: 2}, tilt: {servo: 3}}"
    file.write_text(f"robot: two\nhead: {head}\nmast: {mast}\n")
    shown = mission("robot", "show", str(file)).out
    assert "  pan (servo 0): -80 to 80 deg, trim +4 deg\n" in shown
    assert "  pan (servo 2): -90 to 90 deg\n  tilt (servo 3): -90 to 90 deg\n" in shown


def test_a_port_without_a_path_is_refused(mission: Mission) -> None:
    refused = mission("run", "look_around", "--robot", "turtlebot2_arm", "--port", "head=")
    assert (refused.code, "'head=' is not NAME=VALUE, such as base=/dev/ttyUSB0" in refused.err) == (2, True)


def test_unwritable_defaults_file_is_reported_with_a_hint(mission: Mission) -> None:
    (config_folder().parent).mkdir(parents=True, exist_ok=True)
    config_folder().touch()
    told = mission("robot", "use", "turtlebot2")
    assert told.code == 2
    assert (
        f"{config_folder() / 'defaults.yaml'}: there is no folder {config_folder()}: {config_folder()} is in the way"
        in told.err
    )
    assert f"try: ls -l {config_folder()}" in told.err
