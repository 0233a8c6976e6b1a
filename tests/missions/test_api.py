"""MissionTree from Python, as ``missions`` documents it."""

import doctest
import inspect
import os
import re
import signal
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from py_trees import display
from py_trees.common import Status

import missions
from behaviours.robot import Robot
from drivers.errors import BadRequest
from missions.executive.events import CommandSent, Ended, Event, NodeChanged, Started, Ticked
from missions.executive.executive import Result
from missions.options import options_of
from missions.plugins.testing.recorders import STOP, LeafTestBench
from missions.request import RunRequest
from tests.missions.command import PATIENCE, command
from tests.missions.lone_base import LONE_ROBOT, lone_base
from tests.missions.studio.running import DRIVING, WAITING, found_of
from tests.waiting import wait_until

DRIVE = "mission: go\ntree:\n  drive: 2 m\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "mission.yaml"


def test_the_documented_examples_run() -> None:
    assert doctest.testmod(missions) == doctest.TestResults(failed=0, attempted=5)


def test_public_names_exist_and_no_others() -> None:
    for name in missions.__all__:
        assert getattr(missions, name).__name__ == name
    with pytest.raises(AttributeError, match="module 'missions' has no attribute 'nothing'"):
        _ = missions.nothing


def test_mission_without_claims_is_ticked_without_a_robot(file: Path) -> None:
    file.write_text(
        "mission: m\nparams: {text: a}\ntree:\n  sequence:\n    - log: ${text}\n    - pretend: [running, success]\n"
    )
    mission = missions.load(file, params={"text": "b"})
    heard: list[Event] = []
    mission.events.listeners.append(heard.append)
    assert mission.status is Status.INVALID
    assert [mission.tick() for _ in range(2)] == [Status.RUNNING, Status.SUCCESS]
    assert (mission.name, mission.variables["text"]) == ("m", "b")
    assert [event.tick for event in heard if isinstance(event, Ticked)] == [1, 2]
    assert [event.node for event in heard if isinstance(event, NodeChanged) and event.status == "success"] == [
        "1.1",
        "1.2",
        "1",
    ]
    assert "log" in display.ascii_tree(mission.root)


def test_running_mission_can_be_halted_and_restarted(file: Path) -> None:
    file.write_text("mission: m\ntree:\n  wait: 1 min\n")
    mission = missions.load(file)
    with mission:
        assert mission.tick() is Status.RUNNING
        assert mission.halt()
        assert mission.halt()
        assert mission.status is Status.INVALID
        assert mission.tick() is Status.RUNNING
    assert mission.status is Status.INVALID


def test_params_may_be_plain_values(file: Path) -> None:
    file.write_text(
        "mission: m\nparams: {n: 1, on: false}\ntree:\n  succeed:\n  if: ${on and n == 3}\n  invert: true\n"
    )
    mission = missions.load(file, params={"n": 3, "on": True})
    assert mission.tick() is Status.FAILURE
    assert mission.reason == "succeed succeeded"


def test_one_error_holds_all_faults(file: Path) -> None:
    file.write_text("mission: m\ntree:\n  sequence:\n    - drvie: 1 m\n    - drive: 1\n")
    with pytest.raises(missions.InvalidFileError) as caught:
        missions.load(file)
    assert [fault.mark.line for fault in caught.value.diagnostics] == [4, 5]
    with pytest.raises(missions.UnknownNameError):
        missions.load("no_such_mission")


def test_mission_without_its_robot_names_the_missing_parts(file: Path) -> None:
    file.write_text(DRIVE)
    mission = missions.load(file)
    with pytest.raises(BadRequest, match="mission 'go' needs a robot with base, and has none") as caught:
        mission.tick()
    assert "simulate=True" in caught.value.hint
    with pytest.raises(missions.InvalidFileError, match="base"):
        missions.load(file, robot=Robot())


def test_parts_of_ones_own_are_a_robot_too(file: Path) -> None:
    file.write_text(DRIVE)
    bench = LeafTestBench()
    with missions.load(file, robot=Robot(base_part=bench.base)) as mission:
        assert mission.tick() is Status.RUNNING
    assert bench.base.commands[-1] == STOP


@pytest.mark.real_time
def test_simulated_robot_is_open_only_within_the_context(file: Path) -> None:
    file.write_text(DRIVE)
    mission = missions.load(file, robot="turtlebot2_arm", simulate=True)
    heard: list[Event] = []
    mission.events.listeners.append(heard.append)
    with pytest.raises(BadRequest, match="the robot of mission 'go' is not open"):
        mission.tick()
    with mission:
        assert [mission.tick() for _ in range(3)] == [Status.RUNNING] * 3
    commands = [event.values for event in heard if isinstance(event, CommandSent)]
    assert commands[-1] == {"linear": 0.0, "angular": 0.0}
    with pytest.raises(BadRequest, match="not open"):
        mission.tick()


def test_a_ctrl_c_while_ticking_by_hand_is_the_users_and_goes_through(file: Path) -> None:
    (file.parent / "leaf.py").write_text(
        "from behaviours.leaf import Leaf\nclass Stop(Leaf):\n    tag = 'stop_it'\n"
        "    def update(self): raise KeyboardInterrupt\n"
    )
    file.write_text("mission: m\ntree: stop_it\n")
    mission = missions.load(file, behaviours=[file.parent / "leaf.py"])
    with pytest.raises(KeyboardInterrupt):
        mission.tick()


def test_run_returns_its_result_and_emits_events(file: Path) -> None:
    file.write_text("mission: m\nparams: {why: a}\ntree:\n  fail: ${why}\n")
    heard: list[Event] = []
    result = missions.run(file, {"why": "not today"}, listeners=[heard.append])
    assert isinstance(result, Result)
    assert (result.mission, result.result, result.reason, result.ticks) == ("m", "failure", "not today", 1)
    assert isinstance(heard[0], Started)
    assert isinstance(heard[-1], Ended)


@pytest.mark.parametrize(
    ("wishes", "told"),
    [
        ({"simulate": "fast", "camera": "0"}, 'camera gives pictures in real time: it goes with simulate="wire"'),
        ({"simulate": "wire", "ports": {"base": "/dev/kobuki"}}, 'ports names real ports: it goes with robot="NAME"'),
        ({"robot": "turtlebot2", "ports": {"wing": "/dev/wing"}}, "ports: 'wing' is not a part with a port"),
        ({"robot": "turtlebot2", "world": "empty"}, "world is for a simulated robot"),
        ({"simulate": "wire", "speed": 2.0}, 'are for simulated time: add simulate="fast"'),
        ({"simulate": "wire", "camera": "no_such.png"}, "camera: 'no_such.png': not a file"),
    ],
)
def test_a_run_is_refused_where_a_wish_could_only_be_ignored(file: Path, wishes: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=re.escape(told)):
        missions.run(file, **wishes)


def test_a_run_off_the_main_thread_leaves_the_signals_alone(file: Path) -> None:
    file.write_text("mission: m\ntree: succeed\n")
    found: list[Result] = []
    before = signal.getsignal(signal.SIGINT)
    thread = Thread(target=lambda: found.append(missions.run(file)))
    thread.start()
    thread.join(30.0)
    assert [result.result for result in found] == ["success"]
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.real_time
def test_mission_stop_ends_two_runs_of_one_process(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file.write_text(DRIVING)
    other = tmp_path / "other.yaml"
    other.write_text(WAITING)
    found: list[Result] = []
    with lone_base() as base:
        ports = {"base": base.port}
        works = [
            lambda: missions.run(other, robot="turtlebot2", simulate="wire"),
            lambda: missions.run(file, robot=LONE_ROBOT, ports=ports),
        ]
        threads = [Thread(target=lambda work=work: found.append(work())) for work in works]
        for number, thread in enumerate(threads, 1):
            thread.start()
            wait_until(lambda number=number: len(found_of(os.getpid())) == number)  # type: ignore[misc]
        wait_until(lambda: base.seen().top > 0.1)
        stopped = command(capsys, "stop", "driving")
        assert f"{os.getpid()}: driving on turtlebot2: stopped (base" in stopped.out
        wait_until(lambda: not base.seen().moving)
        ended = command(capsys, "stop", "--end", str(os.getpid())).out
        assert ended.count("is being ended") == 2
        for thread in threads:
            thread.join(PATIENCE)
    assert [result.result for result in found] == ["interrupted"] * 2
    assert found_of(os.getpid()) == []


def test_a_mission_ticked_by_hand_is_stopped_and_released_and_ended_by_mission_stop(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file.write_text(DRIVE)
    with missions.load(file, robot="turtlebot2", simulate="fast") as mission:
        base = mission.root.robot.base  # type: ignore[attr-defined]

        def speed() -> float:
            return float(base.state().value.velocity.linear)

        for _ in range(20):
            assert mission.tick() is Status.RUNNING
        assert speed() > 0.05
        assert "stopped (base" in command(capsys, "stop").out
        for _ in range(20):
            mission.tick()
        assert speed() == 0.0
        assert "resumed" in command(capsys, "stop", "--release", "--resume").out
        for _ in range(20):
            mission.tick()  # it has failed, and begins anew
        assert speed() > 0.05
        command(capsys, "stop", "--end")
        assert mission.tick() is not Status.RUNNING
    assert found_of(os.getpid()) == []


def test_the_options_of_a_run_are_arguments_with_the_declared_defaults() -> None:
    arguments = inspect.signature(missions.run).parameters
    for option in options_of(RunRequest):
        assert option.name in arguments, option.name
        default = arguments[option.name].default
        assert (default or None) == (option.default or None), option.name


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"seed": -1}, "seed: must be at least 0, got -1"),
        ({"speed": -1.0, "simulate": "fast"}, "speed: must be from 0.001 to 10000, got -1.0"),
        ({"eyes": "blurred", "simulate": "fast"}, "eyes: must be one of pixels, truth, got 'blurred'"),
        ({"ros2_domain": 233}, "ros2_domain: must be from 0 to 232, got 233"),
        ({"seed": "two"}, "seed: must be a number, got 'two'"),
        ({"until": 5.0}, "until are for simulated time"),
    ],
)
def test_option_out_of_bounds_is_refused(options: dict[str, Any], why: str) -> None:
    with pytest.raises(ValueError, match=re.escape(why)):
        missions.run("greet", **options)


def test_until_ends_a_run_in_simulated_time(file: Path) -> None:
    file.write_text("mission: m\ntree:\n  wait: 1 min\n")
    result = missions.run(file, simulate="fast", until=2.0)
    assert (result.result, result.reason) == ("interrupted", "still running after 2 s of simulated time: wait (line 3)")
