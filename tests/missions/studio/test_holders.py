"""Commands that move a robot, and runs that hang: ``mission stop`` reaches them, and says what they are."""

import asyncio
import errno
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import click
import pytest

from missions.control import abstract_sockets, command_broadcast, holders, notes, sockets
from missions.control.abstract_sockets import AbstractName
from missions.control.command_broadcast import send_to_all
from missions.control.run_search import is_own_process
from missions.plugins.studio.run_hub import RunHub
from tests.missions.command import Process, command
from tests.missions.hands.teleop.test_teleop_command import driving
from tests.missions.lone_limbs import LoneLimbs, lone_limbs
from tests.missions.studio.running import REST, found_of, nowhere, run_of, seconds_to_rest
from tests.waiting import wait_until

HEAD = """robot: slow_head
head:
  driver: arduino
  port: /dev/none
  boot: 0 s
  speed: 20 deg/s
  pan: {servo: 0, limits: [-80 deg, 80 deg]}
  tilt: {servo: 1, limits: [-60 deg, 20 deg], flip: true}
"""

ARM = """robot: slow_arm
arm:
  driver: dynamixel
  port: /dev/none
  joints:
    shoulder: {id: 1, model: AX-12A, limits: [-100 deg, 100 deg], speed: 20 deg/s}
"""


@pytest.mark.real_time
def test_mission_stop_ends_teleop_with_the_base_at_rest(capsys: pytest.CaptureFixture[str]) -> None:
    with driving() as (terminal, base):
        name = f"{terminal.process.pid}: teleop on turtlebot2"
        assert command(capsys, "stop", "--list").out == f"{name}\n"
        wait_until(lambda: terminal.hold() and base.seen().moving, pause=0.02)
        since = base.seen().heard_at
        stopped = command(capsys, "stop", "teleop")
        assert (stopped.code, stopped.out) == (0, f"{name}: ended, with its actuators at rest\n")
        assert terminal.process.wait(20.0) == 130
        assert seconds_to_rest(base, since) < REST
        assert terminal.shows("mission teleop: stopped by mission stop (process")
    assert command(capsys, "stop").out == "no mission is running\n"


@contextmanager
def moving(folder: Path, part: str, text: str, *words: str) -> Iterator[tuple[Process, LoneLimbs]]:
    """A command that moves limbs."""
    robot = folder / "robot.yaml"
    robot.write_text(text, encoding="utf-8")
    with lone_limbs(part) as limbs:
        process = Process(*words, "--robot", str(robot), "--port", limbs.port)
        try:
            wait_until(lambda: limbs.seen().moving or process.process.poll() is not None)
            assert process.process.poll() is None, process.errors
            yield process, limbs
        finally:
            process.process.kill()
            process.end()


@pytest.mark.real_time
def test_mission_stop_ends_a_head_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with moving(tmp_path, "head", HEAD, "head", "look", "--pan", "80") as (process, limbs):
        since = limbs.seen().now
        stopped = command(capsys, "stop")
        assert (stopped.code, "head look on slow_head: ended" in stopped.out) == (0, True)
        assert process.process.wait(20.0) == 130
        wait_until(lambda: not limbs.seen().moving)
        assert limbs.seen().moved_at - since < REST
        wait_until(lambda: any("mission head look: stopped by mission stop" in line for line in process.errors), 5.0)


@pytest.mark.real_time
def test_mission_stop_latches_an_arm_movement_until_its_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with moving(tmp_path, "arm", ARM, "servo", "move", "shoulder", "90 deg") as (process, limbs):
        since = limbs.seen().now
        stopped = command(capsys, "stop", "move_joints")
        assert (stopped.code, "stopped (arm)" in stopped.out) == (0, True)
        wait_until(lambda: not limbs.seen().moving)
        assert limbs.seen().moved_at - since < REST
        assert process.process.poll() is None
        assert command(capsys, "stop", "--end").code == 0
        assert process.process.wait(20.0) == 130


def test_hung_run_is_listed_by_name_with_a_hint(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command_broadcast, "RUN_END_TIMEOUT", 0.05)
    with run_of(tmp_path) as (process, _):
        number = process.process.pid
        process.process.send_signal(signal.SIGSTOP)
        wait_until(lambda: stopped(number))  # until then it may answer
        listed = command(capsys, "stop", "--list")
        assert (listed.code, f"{number}: waiting on turtlebot2: hangs" in listed.out) == (1, True)
        assert command(capsys, "stop", "another").err.startswith("no run another")
        told = command(capsys, "stop", "waiting")
        assert (told.code, f"{number}: waiting on turtlebot2: hangs" in told.out) == (1, True)
        assert "SIGTERM did not end it within 0.05 s: perhaps not stopped\n" in told.out
        assert f"  try: if process {number} still exists: kill -9 {number}\n" in told.out
        process.process.send_signal(signal.SIGCONT)
        assert process.process.wait(20.0) == 130


def stopped(process: int) -> bool:
    """Whether each thread of a process has stopped."""
    told = [path.read_text() for path in Path(f"/proc/{process}/task").glob("*/stat")]
    return {line.rpartition(")")[2].split()[0] for line in told} == {"T"}


@contextmanager
def deaf(heeds: str = "SIG_IGN") -> Iterator[int]:
    """A process that holds a robot, and hears no SIGTERM, unless it ``heeds`` it."""
    program = (
        "import signal, sys\nfrom missions.control.holders import announce_command\n"
        f"signal.signal(signal.SIGTERM, signal.{heeds})\n"
        "with announce_command('teleop', 'turtlebot2'):\n    print(flush=True)\n    sys.stdin.read()\n"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        try:
            yield process.pid
        finally:
            process.kill()


def test_unresponsive_command_is_reported_with_a_hint(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notes, "END_TIMEOUT", 0.05)
    with deaf() as number:
        told = command(capsys, "stop")
        assert told.code == 1
        assert told.out.startswith(f"{number}: teleop on turtlebot2: hangs (SIGTERM did not end it")
        assert f"kill -9 {number}" in told.out


def test_page_stop_ends_commands_once_for_all_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []
    end = notes.RobotHolder.end

    def counted(self: notes.RobotHolder, by: str) -> bool:
        begun.append(by)
        return end(self, by)

    async def stops() -> list[Mapping[str, object]]:
        hub = RunHub(lambda: None)
        return list(await asyncio.gather(*(hub.stop("", f"viewer {n}") for n in range(50))))

    monkeypatch.setattr(notes.RobotHolder, "end", counted)
    monkeypatch.setattr("missions.plugins.studio.run_hub.COMMAND_END_TIMEOUT", 20.0)
    with deaf(heeds="SIG_DFL") as number:
        told = asyncio.run(stops())
    assert told == [{str(number): {"ended": f"{number}: teleop on turtlebot2"}}] * 50
    assert begun == ["viewer 0"]
    monkeypatch.setattr(notes, "END_TIMEOUT", 0.05)
    with deaf() as number:
        assert all("perhaps not stopped" in str(each[str(number)]) for each in asyncio.run(stops()))


def test_note_of_a_killed_command_is_ignored_and_removed() -> None:
    # Processes of other tests may be ending just now, and have notes in this folder, too.
    with deaf() as number:
        pass
    killed, mine = (sockets.socket_folder() / f"{process}.note" for process in (number, os.getpid()))
    assert killed.exists()
    mine.write_text(json.dumps({"name": "teleop", "robot": "turtlebot2", "simulated": ""}), encoding="utf-8")
    assert found_of(os.getpid()) == []
    assert (killed.exists(), mine.exists()) == (False, False)


def test_command_without_reachable_stop_needs_permission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    nowhere(tmp_path, monkeypatch)
    monkeypatch.setattr(abstract_sockets, "bind_marker", refuse)
    done = []

    @click.command()
    @click.option("--simulated", is_flag=True)
    def look(simulated: bool) -> None:
        with holders.hold_robot("turtlebot2", simulated=simulated):
            done.append("looked")
            assert [each.is_command for each in found_of(os.getpid())] == [True]  # a signal of the same user ends it

    with pytest.raises(holders.NoStop) as raised:
        look.main([], standalone_mode=False)
    assert holders.WITHOUT_STOP in raised.value.hint
    assert done == []
    look.main(["--simulated"], standalone_mode=False)
    for word in ("0", "false", "off", "No", "n", "1", "true"):
        monkeypatch.setenv(holders.WITHOUT_STOP, word)
        with pytest.raises(holders.NoStop) as raised:
            look.main([], standalone_mode=False)
        assert (f"{holders.WITHOUT_STOP}={word}" in str(raised.value)) == (word != "No")
    monkeypatch.setenv(holders.WITHOUT_STOP, "Yes")
    look.main([], standalone_mode=False)
    assert done == ["looked"] * 2
    assert capsys.readouterr().err.count("`mission stop` cannot reach this command") == 2


def refuse(name: AbstractName) -> socket.socket:  # noqa: ARG001 - as the function that it stands for
    raise OSError(errno.EPERM, "a system that has no abstract sockets")


def test_command_without_a_folder_is_ended_by_its_abstract_socket(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    nowhere(tmp_path, monkeypatch)
    with deaf(heeds="SIG_DFL") as number:
        stopped = command(capsys, "stop")
    assert (stopped.code, stopped.out) == (0, f"{number}: a command: ended, with its actuators at rest\n")


def test_stop_of_all_does_not_end_its_own_process() -> None:
    with holders.announce_command("teleop", "turtlebot2"):
        assert [(each.run, is_own_process(each)) for each in found_of(os.getpid())] == [(str(os.getpid()), True)]
        assert send_to_all([{"do": "stop"}], "a test") == {}
