"""The control socket of a run: real runs, in processes of their own, on a virtual base that times itself."""

import os
import resource
import stat
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from pathlib import Path

import jsonschema
import pytest

from missions.control import sockets
from missions.control.control import MAX_CLIENTS
from missions.plugins.studio.studio_commands import protocol_schema
from tests.missions.command import PATIENCE, Process, command
from tests.missions.studio.running import DRIVING, REST, Client, found_of, run_of, seconds_to_rest, simulated_run
from tests.waiting import wait_until


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Process]:
    with simulated_run(tmp_path) as found:
        yield found


def client_of(process: Process) -> "closing[_Closed]":
    return closing(_Closed(str(process.process.pid)))


class _Closed(Client):
    def close(self) -> None:
        self.link.close()


def test_control_socket_is_private_and_removed_after_the_run(tmp_path: Path) -> None:
    with simulated_run(tmp_path) as process:
        path = sockets.socket_path(str(process.process.pid))
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert not path.exists()


def test_socket_of_a_killed_run_is_removed(tmp_path: Path) -> None:
    with simulated_run(tmp_path) as process:
        path = sockets.socket_path(str(process.process.pid))
        process.process.kill()
        process.process.wait()
        assert path.exists()
        with suppress(OSError), sockets.open_connection(path):
            pytest.fail("somebody answered")
        assert not path.exists()


def test_scene_contains_the_current_state_and_matches_the_schema(run: Process) -> None:
    with client_of(run) as client:
        client.send(do="watch")
        scene = client.hear(lambda told: told["say"] == "scene")
        jsonschema.validate(scene, protocol_schema())
        assert scene["state"]["changed"]["1.1"][0] == "running"
        assert scene["drawing"]["mission"] == scene["mission"] == "waiting"
        assert scene["limits"]["speed"] > 0
        state = client.hear(lambda told: told["say"] == "state" and "parts" in told)
        jsonschema.validate(state, protocol_schema())
        assert {part["part"] for part in state["parts"]} == {"base", "range"}


@pytest.mark.real_time
def test_base_stops_when_its_driver_is_silent_or_disconnects(
    tmp_path: Path,
) -> None:
    with run_of(tmp_path) as (process, base):
        for silent in (True, False):
            with client_of(process) as client:
                assert client.ask("take", by="Ada")["result"] == {"yours": True}
                client.drive_until_it_moves(base)
                client.drive()
                last = base.seen().heard_at
                assert not silent or seconds_to_rest(base, last) < REST
            assert silent or seconds_to_rest(base, last) < REST


@pytest.mark.real_time
def test_stop_latches_a_driving_base_until_released(tmp_path: Path) -> None:
    with run_of(tmp_path, DRIVING) as (process, base), client_of(process) as client:
        wait_until(lambda: base.seen().top > 0.15)
        asked = base.seen().heard_at
        answer = client.ask("stop", by="Ada")
        assert answer["result"] == {"parts": ["base"], "stops": 1}
        assert seconds_to_rest(base, asked) < REST
        assert client.ask("resume")["error"] == "stopped"
        assert client.ask("step")["error"] == "stopped"
        assert client.ask("release", stop=2)["error"] == "not_stopped"
        assert client.ask("release", stop=1)["ok"]
        client.send(do="watch")
        scene = client.hear(lambda told: told["say"] == "scene")
        assert scene["state"]["paused"]
        assert scene["state"]["stopped"] == ""
        assert scene["way"][0] == [0.0, 0.0]
        assert scene["way"][-1][0] > 0.0  # though nobody has watched it
        assert not base.seen().moving
        assert client.ask("resume")["ok"]
        wait_until(lambda: base.seen().moving)


def test_client_that_does_not_read_does_not_delay_others(run: Process) -> None:
    with client_of(run) as slow, client_of(run) as quick:
        slow.send(do="watch", events=True)
        quick.send(do="watch")
        first = quick.hear(lambda told: told["say"] == "state")["tick"]
        # On a busy machine, one tick may have two states, which come by the time: the ticks count.
        quick.hear(lambda told: told["say"] == "state" and told["tick"] >= first + 19)


@pytest.mark.real_time
def test_paused_simulated_run_is_driven_and_sends_states(run: Process) -> None:
    with client_of(run) as client:
        client.ask("pause")
        assert client.ask("take", by="Ada")["result"] == {"yours": True}
        answers = []
        for _ in range(20):
            answers.append(client.drive())
            client.hear(lambda told: told["say"] == "state")
            client.hear(lambda told: told["say"] == "state")
        assert {answer.get("error") for answer in answers} == {None}
        state = client.hear(lambda told: told["say"] == "state")
        assert (state["paused"], state["driver"]) == (True, "Ada")
        assert 0.0 <= state["round_trip"] < 0.5


def test_invalid_commands_are_answered_with_an_error_name(run: Process) -> None:
    with client_of(run) as client:
        client.link.connection.sendall(b"nonsense\n")
        assert client.hear(lambda told: told["say"] == "answer")["error"] == "no_json"
        assert client.ask("library")["error"] == "unknown_command"  # which is the studio's, not a run's
        assert client.ask("drive", n=1, stamp=0, ahead=9, left=0)["error"] == "bad_field"
        assert client.ask("drive", n=1, stamp=0, ahead=1, left=0)["error"] == "no_wheels"
        for line in (
            b'{"id": 70, "do": ',
            b'{"id": 70, "do": "fly"}',
            b'{"id": 70, "do": "stop", "run": ' + b"[" * 5000,
        ):
            client.link.connection.sendall(line + b"\n")
            assert client.hear(lambda told: told["say"] == "answer")["id"] == 70
        client.link.connection.sendall(b'{"id": 70, "do": "stop", "run": "' + b"x" * 70_000 + b'"}\n')
        answer = client.hear(lambda told: told["say"] == "answer")
        assert (answer["error"], answer["id"]) == ("too_large", 70)
        client.link.connection.sendall(b"x" * 200_000)
        assert client.hear(lambda told: told["say"] == "answer")["error"] == "too_large"


def test_halted_run_reports_its_result(tmp_path: Path) -> None:
    with simulated_run(tmp_path) as process, client_of(process) as client:
        client.send(do="watch")
        assert client.ask("halt", by="Ada")["ok"]
        over = client.hear(lambda told: told["say"] == "over")
        assert (over["result"], over["reason"]) == ("interrupted", "halted by Ada")
        jsonschema.validate(over, protocol_schema())


@pytest.mark.real_time
def test_mission_stop_stops_a_run_of_another_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with run_of(tmp_path, DRIVING) as (process, base):
        wait_until(lambda: base.seen().top > 0.15)
        name = f"{process.process.pid}: driving on turtlebot2"
        assert command(capsys, "stop", "--list").out == f"{name}: running\n"
        stopped = command(capsys, "stop")
        assert (stopped.code, stopped.out) == (0, f"{name}: stopped (base)\n")
        assert command(capsys, "stop", "--list").out.startswith(f"{name}: stopped by mission stop (process ")
        wait_until(lambda: not base.seen().moving)
        released = command(capsys, "stop", "--release", "--resume", "driving")
        assert (released.code, released.out) == (0, f"{name}: released, and paused: resumed\n")
        wait_until(lambda: base.seen().moving)
        again = command(capsys, "stop", "--release")
        assert (again.code, again.out) == (1, f"{name}: not stopped: nothing to release\n")
        both = command(capsys, "stop", "--release", "--resume")
        assert (both.code, both.out) == (0, f"{name}: was not stopped; it goes on\n")
        ended = command(capsys, "stop", "--end", str(process.process.pid))
        assert (ended.code, ended.out) == (0, f"{name}: stopped (base): is being ended\n")
        wait_until(lambda: process.process.poll() is not None)


def test_loading_run_is_ended_before_its_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "slow.py").write_text("import time\ntime.sleep(1000)\n", encoding="utf-8")
    mission = tmp_path / "slow.yaml"
    mission.write_text("mission: slow\ntree:\n  drive: 1 m\n", encoding="utf-8")
    process = Process("run", str(mission), "--behaviours", str(tmp_path / "slow.py"))
    wait_until(lambda: found_of(process.process.pid))
    stopped = command(capsys, "stop", str(mission))
    assert (stopped.code, "ended, with its actuators at rest" in stopped.out) == (0, True)
    assert process.end() == -15


def test_mission_stop_without_a_run_reports_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert command(capsys, "stop").out == "no mission is running\n"
    missing = command(capsys, "stop", "greet")
    assert (missing.code, missing.err) == (1, "no run greet: `mission stop --list` lists the runs\n")


def test_hung_run_is_stopped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "hang.py").write_text(
        "import time\nfrom behaviours.leaf import Leaf\nfrom py_trees.common import Status\n"
        "class Hang(Leaf):\n    '''Hang.'''\n    tag = 'hang'\n"
        "    def update(self):\n        time.sleep(60)\n        return Status.SUCCESS\n",
        encoding="utf-8",
    )
    steps = "    - drive: {distance: 100 m, speed: 0.4 m/s}\n    - sequence:\n        - wait: 500 ms\n        - hang\n"
    text = f"mission: hangs\ntree:\n  parallel:\n{steps}"
    with run_of(tmp_path, text, "--behaviours", str(tmp_path / "hang.py")) as (process, base):
        wait_until(lambda: base.seen().top > 0.15)
        wait_until(lambda: not base.seen().moving)  # the watchdog keeps it still
        stopped = command(capsys, "stop", "--end")
        assert "stopped (base)" in stopped.out
        os.kill(process.process.pid, 0)
        wait_until(lambda: process.process.poll() is not None, 30.0)


def test_run_with_many_open_connections_is_stopped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with run_of(tmp_path) as (process, base), ExitStack() as ends:
        driver = Client(str(process.process.pid))
        ends.callback(driver.link.close)
        driver.ask("take")
        for _ in range(2 * MAX_CLIENTS):
            ends.enter_context(sockets.open_connection(sockets.socket_path(str(process.process.pid))))
        driver.drive_until_it_moves(base)
        stopped = command(capsys, "stop")
        assert (stopped.code, "stopped (base)" in stopped.out) == (0, True)
        wait_until(lambda: not base.seen().moving)


def test_run_that_accepts_no_connections_is_ended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with simulated_run(tmp_path) as process, ExitStack() as ends:
        for _ in range(MAX_CLIENTS):
            client = Client(str(process.process.pid))
            ends.callback(client.link.close)
            client.ask("watch")
        stopped = command(capsys, "stop")
        assert (stopped.code, "ended by SIGTERM" in stopped.out) == (0, True)
        assert process.process.wait(PATIENCE) != 0


@pytest.mark.real_time
def test_run_without_free_descriptors_neither_accepts_nor_spins(
    run: Process,
) -> None:
    number = run.process.pid
    before = resource.prlimit(number, resource.RLIMIT_NOFILE, (3, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    used = processor_time(number)
    with sockets.open_connection(sockets.socket_path(str(number))) as link:
        assert not link.run_info  # for all of the second for which it is waited
        assert processor_time(number) - used < 0.5 * sockets.REPLY_TIMEOUT
        resource.prlimit(number, resource.RLIMIT_NOFILE, before)
        assert link.receive()["pid"] == number


def processor_time(process: int) -> float:
    """Return the seconds of processor time that a process has used."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
