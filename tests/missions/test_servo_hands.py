"""``mission simulate`` takes what a person does to the devices: by a line of words each, from a pipe or a terminal."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from math import radians
from pathlib import Path

import pytest

from config.library import find_file
from drivers.clock import SystemClock
from drivers.servos.virtual.chain import VirtualServoBus
from missions.assembly.simulation import Simulation
from missions.library.drivers import load_robot
from missions.plugins.testing.commands.simulate import COMMAND_HELP, DeviceCommands, LineReader

ROBOT = load_robot(find_file("robots", "turtlebot2_arm"))


@pytest.fixture
def simulation() -> Iterator[Simulation]:
    found = Simulation(ROBOT, frozenset({"arm", "head"}), SystemClock())
    found.open()
    yield found
    found.close()


def test_a_limp_joint_is_turned_by_hand_and_a_stiff_one_resists(simulation: Simulation) -> None:
    hands, servos = DeviceCommands(simulation, ROBOT), simulation.device(VirtualServoBus)
    assert servos is not None
    assert hands.run_command("turn elbow 30 deg") == "turn elbow 30 deg"
    elbow = servos.servo(6)
    assert elbow.angle == pytest.approx(radians(30))
    elbow.set("torque_enable", 1)
    with pytest.raises(ValueError, match=r"elbow \(servo 6\): its torque is on"):
        hands.run_command("turn elbow 0 deg")


def test_simulation_commands_set_heat_load_and_power_of_servos(simulation: Simulation) -> None:
    hands, servos = DeviceCommands(simulation, ROBOT), simulation.device(VirtualServoBus)
    assert servos is not None
    for line in ("heat gripper 70 degC", "burden gripper 40 %", "remove elbow", "brown_out waist_turn 500 ms"):
        hands.run_command(line)
    assert (servos.servo(10).temperature, servos.servo(10).load, servos.servo(6).present) == (70.0, 0.4, False)
    assert not servos.servo(1).is_awake
    servos.servo(10).set("led", 1)
    hands.run_command("power gripper")
    hands.run_command("insert elbow")
    assert (servos.servo(10).get("led"), servos.servo(6).present) == (0, True)


def test_simulated_joint_keeps_its_name_after_an_id_change(simulation: Simulation) -> None:
    servos = simulation.device(VirtualServoBus)
    assert servos is not None
    elbow = servos.servo(6)
    hands = DeviceCommands(simulation, ROBOT)
    elbow.set("id", 77)
    hands.run_command("turn elbow 10 deg")
    assert elbow.angle == pytest.approx(radians(10))


def test_plugs_are_pulled_and_put_in_again(simulation: Simulation) -> None:
    hands = DeviceCommands(simulation, ROBOT)
    hands.run_command("unplug arm")
    assert [Path(port).exists() for port in simulation.ports.values()] == [True, False]
    hands.run_command("unplug")
    assert not any(Path(port).exists() for port in simulation.ports.values())
    hands.run_command("plug")
    assert all(Path(port).exists() for port in simulation.ports.values())


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("trun elbow 30 deg", "did you mean 'turn'"),
        ("turn elbwo 30 deg", "did you mean 'elbow'"),
        ("turn elbow 30", "has no unit"),
        ("turn", "no joint ''"),
        ("overload elbow now", "nothing else"),
        ("unplug leg", "no part 'leg'"),
    ],
)
def test_invalid_simulation_commands_are_refused(simulation: Simulation, line: str, words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("'", ".")):
        DeviceCommands(simulation, ROBOT).run_command(line)


def test_help_names_every_command(simulation: Simulation) -> None:
    assert all(word in DeviceCommands(simulation, ROBOT).run_command("help") for word in COMMAND_HELP)


def test_line_reader_joins_split_lines_and_ends_with_the_pipe() -> None:
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as cat:
        assert cat.stdin is not None
        assert cat.stdout is not None
        lines = LineReader(cat.stdout.fileno())
        found: list[str] = []
        for piece in (b"turn el", b"bow 3 deg\nunplug\nhe", b"lp\n"):
            cat.stdin.write(piece)
            cat.stdin.flush()
            found += lines.wait(5.0)
        cat.stdin.close()
        cat.wait()
        while len(found) < 3:
            found += lines.wait(5.0)
    assert found == ["turn elbow 3 deg", "unplug", "help"]
    assert list(lines.wait(0.0)) == []


def test_simulate_answers_each_line_and_continues_without_stdin(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "missions", "simulate", "--robot", "turtlebot2_arm", "--paced"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
    )
    try:
        assert process.stdin is not None
        assert process.stdout is not None
        port = Path(json.loads(process.stdout.readline())["ports"]["arm"])
        process.stdin.write("unplug arm\njump\n")
        process.stdin.close()
        assert json.loads(process.stdout.readline()) == {"done": "unplug arm"}
        assert not port.exists()
        assert "unknown command 'jump'" in json.loads(process.stdout.readline())["error"]
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == 0
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()
