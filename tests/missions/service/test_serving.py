"""The server: one task after another, and an end that is safe whatever it is in the middle of."""

import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from missions.plugins.tasks.run_process import Say, Stopping
from missions.plugins.tasks.task import AttemptOutcome, Claim, RetryPolicy
from missions.plugins.tasks.task_server import TaskServer
from tests.missions.service.small_queue import Shop, new, shop


@pytest.fixture
def queue(tmp_path: Path) -> Iterator[Shop]:
    with shop(tmp_path / "tasks.db") as opened:
        yield opened


def serve(queue: Shop, work: Callable[[Claim, Stopping, Say], AttemptOutcome], look: float = 0.0) -> list[str]:
    """Serve once; return what was told. Each look at the clock takes ``look`` seconds."""
    told: list[str] = []

    def now() -> float:
        queue.now += look
        return queue.now

    TaskServer(queue.queue, work, now, told.append).run(once=True)
    return told


def test_server_runs_due_tasks_in_order_and_reports_each(queue: Shop) -> None:
    for mission in ("greet", "wander"):
        queue.add(new(mission))
    queue.add(new(due=queue.now + 60.0))
    order: list[int] = []

    def work(claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
        order.append(claim.task.id)
        say("on my way")
        say("there")
        assert not stopping()
        return AttemptOutcome("success")

    assert serve(queue, work) == ["task 1: greet begins", "task 2: wander begins"]
    assert order == [1, 2]
    assert queue.told(1) == ["on my way", "there", "greet (task 1) is done"]
    assert queue.queue.task(3).state == "waiting"


def test_server_begins_with_interrupted_tasks(queue: Shop) -> None:
    queue.add(new())
    queue.claim()
    assert serve(queue, lambda *_: AttemptOutcome("success")) == ["task 1: greet begins, attempt 2"]
    assert queue.kinds(1) == ["interrupted", "done"]


def test_worker_is_stopped_when_its_task_is_cancelled(queue: Shop) -> None:
    queue.add(new(every="60 s"))

    def work(claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
        del say
        assert not stopping()
        queue.queue.cancel(claim.task.id, queue.now)
        assert stopping()
        return AttemptOutcome("interrupted", "SIGTERM")

    serve(queue, work)
    assert [task.state for task in queue.queue.tasks()] == ["cancelled"]


def test_stopped_server_leaves_the_remaining_tasks(queue: Shop) -> None:
    for _ in range(2):
        queue.add(new())
    server: TaskServer

    def work(claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
        del claim, say
        server.stop("SIGTERM")
        assert stopping()
        return AttemptOutcome("interrupted", "SIGTERM")

    server = TaskServer(queue.queue, work, lambda: queue.now, lambda _: None)
    server.run()
    assert [task.state for task in queue.queue.tasks()] == ["waiting", "waiting"]
    assert queue.told(1) == ["greet (task 1) was interrupted: the server was stopped: SIGTERM; it is tried again"]
    assert queue.queue.task(1).interruptions == 0, "that somebody stops the server does not count"


def test_run_that_cannot_be_started_fails(queue: Shop) -> None:
    queue.add(new(policy=RetryPolicy(retries=1)))

    def work(*_: object) -> AttemptOutcome:
        raise OSError(12, "Cannot allocate memory")

    serve(queue, work, look=20.0)
    task = queue.queue.task(1)
    assert (task.state, task.attempts) == ("failed", 2)
    assert task.reason.startswith("no process could be started: ")
    assert "Cannot allocate memory" in task.reason


def test_once_waits_for_retries_and_runs_others_meanwhile(queue: Shop) -> None:
    queue.add(new("absent", policy=RetryPolicy(retries=1)))
    queue.add(new("greet"))
    order: list[str] = []

    def work(claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
        del stopping, say
        order.append(claim.task.mission)
        return AttemptOutcome("failure" if order == ["absent"] else "success")

    serve(queue, work, look=4.0)
    assert order == ["absent", "greet", "absent"]


def test_full_disk_delays_but_does_not_lose_the_result(queue: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    queue.add(new())
    finish, full = queue.queue.finish, ["database or disk is full"] * 2

    def finish_if_there_is_room(claim: Claim, outcome: AttemptOutcome, now: float) -> object:
        if full:
            raise sqlite3.OperationalError(full.pop())
        return finish(claim, outcome, now)

    monkeypatch.setattr(queue.queue, "finish", finish_if_there_is_room)
    done: list[int] = []

    def work(claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
        del stopping, say
        done.append(claim.attempt)
        return AttemptOutcome("success")

    told = serve(queue, work)
    assert told == [
        "task 1: greet begins",
        "the queue cannot be used: database or disk is full",
        "the queue can be used again",
    ]
    assert (done, queue.queue.task(1).state) == ([1], "done")


def test_unwritten_result_is_recovered_by_the_next_server(queue: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    queue.add(new())
    server: TaskServer

    def finish(*_: object) -> None:
        server.stop("SIGTERM")
        raise sqlite3.OperationalError("disk I/O error")

    with monkeypatch.context() as broken:
        broken.setattr(queue.queue, "finish", finish)
        server = TaskServer(queue.queue, lambda *_: AttemptOutcome("success"), lambda: queue.now, lambda _: None)
        server.run()
    assert queue.queue.task(1).state == "running"
    serve(queue, lambda *_: AttemptOutcome("success"))
    assert [attempt.how for attempt in queue.queue.attempts(1)] == ["interrupted", "success"]
