"""``mission task`` and ``mission task serve``, as a user types them."""

import json
import signal
from collections.abc import Iterator
from contextlib import closing
from getpass import getuser
from pathlib import Path
from threading import Event

import pytest

from missions.plugins.tasks.file_lock import hold_lock, is_locked
from missions.plugins.tasks.outbox import Outbox
from missions.plugins.tasks.queue_database import open_db
from tests.missions.command import Outcome, Process, command
from tests.waiting import wait_until

TELL = """
mission: tell
params: {to: {type: text}, time: 60 s}
tree:
  sequence:
    - notify: "looking for ${to}"
    - wait: ${time}
"""


class User:
    """Somebody with a queue of their own, and a mission."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self._capsys = folder, capsys
        self.mission = folder / "tell.yaml"
        self.mission.write_text(TELL, encoding="utf-8")

    @property
    def state(self) -> Path:
        return self.folder / "state" / "missiontree"

    def task(self, *words: str) -> Outcome:
        return command(self._capsys, "task", *words)

    def add(self, *words: str, time: str = "0 s") -> Outcome:
        outcome = self.task("add", str(self.mission), "--param", "to=Ana", "--param", f"time={time}", *words)
        assert outcome.code == 0, outcome.err
        return outcome

    def tasks(self) -> list[dict[str, object]]:
        listed: list[dict[str, object]] = json.loads(self.task("list", "--all", "--json").out)
        return listed

    def state_of(self, number: int) -> object:
        return next(task["state"] for task in self.tasks() if task["id"] == number)

    @property
    def lock(self) -> Path:
        return self.state / "run.lock"


@pytest.fixture
def user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> User:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("TZ", "Europe/Berlin")
    return User(tmp_path, capsys)


@pytest.fixture
def server(user: User) -> Iterator[Process]:
    """A server of the user's, which the test ends; with whatever it runs, it is gone then."""
    process = Process("task", "serve")
    try:
        yield process
    finally:
        if process.process.poll() is None:
            process.end(signal.SIGKILL)
        wait_until(lambda: not is_locked(user.lock), 60.0)


def serve_once() -> list[str]:
    """Serve until nothing is due; return what stood on the terminal."""
    process = Process("task", "serve", "--once")
    wait_until(lambda: process.process.poll() is not None, 100.0)
    assert process.end() == 0
    return process.lines


# What is asked of the queue


def test_move_changes_the_priority_of_a_waiting_task(user: User) -> None:
    user.add()
    user.add()
    assert user.task("move", "2", "--priority", "5").out == "task 2 has priority 5\n"
    assert [task["id"] for task in user.tasks()] == [2, 1]
    user.task("remove", "1")
    assert user.task("move", "1", "--priority", "5").err.startswith("Error: task 1 is not waiting: it is cancelled")
    assert "there is no task 9" in user.task("move", "9", "--priority", "5").err


def test_task_that_needs_approval_begins_once_approved(user: User) -> None:
    added = user.add("--needs-approval")
    assert "it waits for approval: mission task approve 1\n" in added.out
    serve_once()
    assert "needs approval" in user.task("list").out
    assert user.state_of(1) == "waiting"
    assert user.task("approve", "1").out == "task 1 is approved\n"
    assert "task 1 needs no approval" in user.task("approve", "1").err
    assert f"approved by {getuser()}\n" in user.task("log", "1").out
    serve_once()
    assert user.state_of(1) == "done"
    assert "task 1 is not waiting: it is done" in user.task("approve", "1").err


def test_a_task_is_added_listed_cancelled_and_logged(user: User) -> None:
    added = user.add("--at", "2126-12-24 18:00")
    assert added.out == "task 1: tell runs at 2126-12-24 18:00:00\n"
    assert added.err == "no server is running the tasks: mission task serve\n"
    listed = user.task("list").out.splitlines()
    assert listed[1].split()[:4] == ["1", "waiting", "2126-12-24", "18:00:00"]
    assert "to=Ana time=0 s" in listed[1]
    assert user.task("remove", "1").out == "task 1 is cancelled\n"
    assert user.task("list").out == "no waiting tasks; --all shows the ended ones\n"
    assert user.task("log", "1").out.splitlines()[0] == "task 1: tell, cancelled: it was cancelled"
    assert json.loads(user.task("log", "1", "--json").out)["task"]["state"] == "cancelled"


def test_task_is_stored_with_paths_for_any_working_directory(user: User, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(user.folder)
    user.mission = Path("tell.yaml")
    user.add("--simulate", "fast", "--eyes", "truth", "--world", "party", "--robot", "turtlebot2_arm")
    (task,) = user.tasks()
    assert task["mission"] == str(user.folder / "tell.yaml")
    assert (task["robot"], task["params"]) == ("turtlebot2_arm", {"to": "Ana", "time": "0 s"})
    assert task["options"] == ["--simulate=fast", "--world=party", "--eyes=truth"]
    assert (task["late"], task["every"]) == (None, "")
    assert user.task("add", "greet").code == 0
    assert user.tasks()[1]["mission"] == "greet"


def test_repetition_and_policy_are_stored(user: User) -> None:
    out = user.add("--at", "18:00", "--every", "monday", "--retry", "2", "--if-interrupted", "give-up").out
    assert out.endswith("then every monday 18:00\n")
    (task,) = user.tasks()
    assert task["policy"] == {"interrupted": "give-up", "most": 3, "retries": 2}
    assert (task["late"], task["series"]) == (3600.0, 1)


def test_if_interrupted_option_overrides_the_mission(user: User) -> None:
    user.add()
    user.mission.write_text(TELL.replace("tree:", "if_interrupted: give_up\ntree:"), encoding="utf-8")
    user.add()
    user.add("--if-interrupted", "retry")
    policies = [task["policy"] for task in user.tasks()]
    assert [policy["interrupted"] for policy in policies if isinstance(policy, dict)] == ["retry", "give-up", "retry"]


def test_priority_is_stored_and_listed_if_not_zero(user: User) -> None:
    user.add()
    assert "priority" not in user.task("list").out
    user.add("--priority", "7", "--every", "30 min")
    headings, first, second = user.task("list").out.splitlines()
    assert headings.split()[:4] == ["task", "state", "priority", "due"]
    assert (first.split()[:3], second.split()[:3]) == (["2", "waiting", "7"], ["1", "waiting", "0"])
    assert [task["due"] for task in user.tasks()] == [0.0, 0.0], "as soon as their turn comes"
    refused = user.task("add", "greet", "--priority", "101")
    assert (refused.code, "-100<=x<=100" in refused.err) == (2, True)


def test_param_that_is_not_utf_8_is_refused(user: User) -> None:
    refused = user.task("add", str(user.mission), "--param", "to=Ren\udce9")
    assert refused.code == 2
    assert "'to=Ren\\xe9' is not UTF-8 text" in refused.err
    assert user.tasks() == []


def test_list_shows_times_beyond_the_calendar(user: User) -> None:
    user.add("--every", "30 min")
    with closing(open_db(user.state / "tasks.db")) as connection:
        connection.execute("UPDATE task SET due = 1e300, every = '1e15 s'")
    assert "1e+300  1e15 s" in user.task("list").out
    assert user.task("log", "1").code == 0


def test_damaged_queue_is_reported(user: User, capsys: pytest.CaptureFixture[str]) -> None:
    user.add()
    path = user.state / "tasks.db"
    path.write_bytes(path.read_bytes()[:4096] + b"\x5a" * 65536)
    for outcome in (user.task("list"), command(capsys, "task", "serve", "--once")):
        assert outcome.code == 2
        assert f"{path}: is damaged, or not a task queue: " in outcome.err
        assert f"try: mv {path} {path}.broken" in outcome.err


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["greet", "--at", "25:00"], "'25:00' is not a time of day"),
        (["greet", "--at", "2001-01-01 00:00"], "is in the past"),
        (["greet", "--every", "mondy"], "did you mean 'monday'"),
        (["gret"], "did you mean 'greet'"),
        (["greet", "--robot", "nobody"], "unknown robot 'nobody'"),
        (["greet", "--world", "nowhere"], "unknown world 'nowhere'"),
        (["greet", "--param", "patience=long"], "patience"),
        (["greet", "--eyes", "truth"], "add --simulate fast"),
    ],
)
def test_invalid_task_is_refused_when_added(user: User, words: list[str], why: str) -> None:
    refused = user.task("add", *words)
    assert refused.code == 2
    assert why in refused.err
    assert not user.state.exists() or user.tasks() == []


def test_mission_with_a_missing_param_is_refused(user: User) -> None:
    refused = user.task("add", str(user.mission))
    assert (refused.code, "to" in refused.err) == (2, True)


@pytest.mark.parametrize("words", [["remove", "3"], ["log", "3"]])
def test_unknown_task_number_is_an_error(user: User, words: list[str]) -> None:
    outcome = user.task(*words)
    assert (outcome.code, outcome.err) == (2, "Error: there is no task 3\n  try: mission task list --all\n")


def test_a_second_server_is_refused(user: User, capsys: pytest.CaptureFixture[str]) -> None:
    with hold_lock(user.state / "serve.lock"):
        outcome = command(capsys, "task", "serve", "--once")
    assert outcome.code == 2
    assert "another `mission task serve` runs the tasks" in outcome.err


# Real runs


@pytest.mark.real_time
def test_tasks_are_run_and_reported_on_the_terminal(user: User) -> None:
    user.add()
    user.add("--simulate", "fast")
    lines = [line.partition("  ")[2] for line in serve_once()]
    assert lines == [
        "looking for Ana  (task 1)",
        "tell (task 1) is done",
        "looking for Ana  (task 2)",
        "tell (task 2) is done",
    ]
    assert user.task("log", "1").out.count("delivered to terminal: ") == 2


@pytest.mark.real_time
def test_killed_server_leaves_no_run_and_the_next_reports_the_interruption(user: User, server: Process) -> None:
    user.add("--if-interrupted", "give-up", time="600 s")
    server.wait_for_line(lambda line: "looking for Ana" in line, seconds=60.0)
    assert user.state_of(1) == "running"
    server.end(signal.SIGKILL)
    wait_until(lambda: not is_locked(user.lock), 60.0)
    told = serve_once()
    assert any("was interrupted, and is given up: the computer or the server went down" in line for line in told)
    assert user.state_of(1) == "given_up"


@pytest.mark.real_time
def test_running_task_is_cancelled_while_the_server_continues(user: User, server: Process) -> None:
    user.add(time="600 s")
    server.wait_for_line(lambda line: "looking for Ana" in line, seconds=60.0)
    assert user.task("remove", "1").out == "task 1 is being stopped\n"
    wait_until(lambda: user.state_of(1) == "cancelled", 60.0)
    user.add()
    wait_until(lambda: user.state_of(2) == "done", 60.0)
    (attempt,) = json.loads(user.task("log", "1", "--json").out)["attempts"]
    assert (attempt["how"], attempt["reason"]) == ("cancelled", "SIGTERM")
    assert server.end(signal.SIGTERM) == 0


@pytest.mark.real_time
def test_stopped_server_stops_its_run_and_keeps_the_task(user: User, server: Process) -> None:
    user.add("--if-interrupted", "retry", time="600 s")
    server.wait_for_line(lambda line: "looking for Ana" in line, seconds=60.0)
    assert server.end(signal.SIGINT) == 0
    assert any("was interrupted" in line for line in server.lines)
    assert not is_locked(user.lock)
    (task,) = user.tasks()
    assert (task["state"], task["attempts"], task["interruptions"]) == ("waiting", 1, 0)
    assert task["reason"] == "the server was stopped: SIGTERM"


def test_task_output_hides_secret_addresses(user: User) -> None:
    robot = user.folder / "rob.yaml"
    robot.write_text("robot: rob\nvoice: {driver: print}\nnotices:\n  - webhook: https://chat.example/s3cret\n")
    user.add("--robot", str(robot))
    told = user.task("list", "--json").out + user.task("log", "1", "--json").out + user.task("log", "1").out
    assert "chat.example" in told
    assert "s3cret" not in told


@pytest.mark.real_time
def test_simulated_runs_survive_killed_servers(user: User) -> None:
    for _ in range(3):
        user.add("--simulate", "fast", "--if-interrupted", "retry")
    for seconds in (0.4, 1.1, 2.3):
        process = Process("task", "serve", "--once")
        Event().wait(seconds)
        process.end(signal.SIGKILL)
    serve_once()
    with closing(open_db(user.state / "tasks.db")) as connection:
        successes = "SELECT task, COUNT(*) FROM attempt WHERE how = 'success' GROUP BY task"
        found = [tuple(row) for row in connection.execute(successes)]
        assert found == [(number, 1) for number in range(1, 4)]
        assert Outbox(connection).pending_count() == 0
    assert {task["state"] for task in user.tasks()} == {"done"}


def test_list_warns_of_tasks_added_in_the_future(user: User) -> None:
    user.add()
    with closing(open_db(user.state / "tasks.db")) as connection:
        connection.execute("UPDATE task SET added = 7258118400.0")
    outcome = user.task("list")
    assert "at once" in outcome.out
    assert "task 1 was added at 2200-01-01" in outcome.err
    assert "mission task remove 1, and add it again" in outcome.err
