"""Hundreds of tasks, and a server that is killed again and again: none is lost, none is completed twice."""

import random
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from threading import Event

import pytest

from missions.plugins.tasks.outbox import Outbox
from missions.plugins.tasks.queue import TaskQueue
from missions.plugins.tasks.queue_database import open_db
from missions.plugins.tasks.task import NewTask, RetryPolicy
from tests.forked import Forked
from tests.missions.service.journal_server import CHANNELS
from tests.tries import tries
from tests.waiting import wait_until

pytestmark = [pytest.mark.real_time, pytest.mark.long]

KILLS = tries(8)
WAITING = 300
"""Tasks that wait at each kill, added while servers work: the last server, which nobody kills, has these left."""

PATIENCE = 400.0
"""Seconds within which the last server does what is left."""


def test_hundreds_of_tasks_survive_a_randomly_killed_server(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    add(tmp_path, WAITING)
    chance, pause = random.Random(9), Event()  # noqa: S311 - chance, not a secret
    kills, tasks = 0, WAITING
    for _ in range(KILLS):
        before = len(journal(tmp_path / "done"))
        with server(tmp_path) as process:
            wait_until(lambda: process.poll() is not None or len(journal(tmp_path / "done")) > before, 60.0, pause=0.01)  # noqa: B023
            more = max(0, WAITING + len(journal(tmp_path / "done")) - tasks)
            add(tmp_path, more)
            tasks += more
            pause.wait(chance.uniform(0.0, 0.06))
            process.kill()
            kills += process.wait() != 0
    with server(tmp_path) as process:
        assert process.wait(PATIENCE) == 0
    assert kills == KILLS, "the queue was empty too early"
    check(tmp_path, kills, tasks)
    record_property("figure", f"{kills} kills, {tasks} tasks, none lost, none completed twice")


def server(folder: Path) -> Forked:
    return Forked("tests.missions.service.journal_server", str(folder))


def add(folder: Path, tasks: int) -> None:
    with closing(open_db(folder / "tasks.db")) as connection:
        connection.execute("PRAGMA synchronous = OFF")
        queue = TaskQueue(connection, lambda _: CHANNELS)
        for _ in range(tasks):
            queue.add(NewTask(mission="note", due=0.0, policy=RetryPolicy("retry", KILLS + 1)), 0.0)


def check(folder: Path, kills: int, added: int) -> None:
    done, delivered = journal(folder / "done"), Counter(journal(folder / "delivered"))
    with closing(open_db(folder / "tasks.db")) as connection:
        queue, outbox = TaskQueue(connection, lambda _: CHANNELS), Outbox(connection)
        tasks = queue.tasks()
        attempts = [attempt for task in tasks for attempt in queue.attempts(task.id)]
        letters = [letter for task in tasks for letter in outbox.notices_of(task.id)]

    assert Counter(task.state for task in tasks) == {"done": added}
    assert Counter(attempt.task for attempt in attempts if attempt.how == "success") == Counter(range(1, added + 1))
    interrupted = {attempt.id for attempt in attempts if attempt.how == "interrupted"}
    assert len(interrupted) == len(attempts) - added <= kills

    # What was done although its attempt was interrupted is what nobody can exclude: it is told, and rare.
    assert len(done) == len(set(done)), "one attempt does its task once"
    again = {int(line) for line in done} & interrupted
    assert len(done) - added == len(again) <= kills

    # Each notice was delivered, and twice only where the courier was killed in between, at one for each channel.
    wanted = {f"{letter.channel} {letter.notice.id}" for letter in letters}
    assert len(wanted) == len(letters) == 2 * len(attempts)
    assert delivered.keys() == wanted
    assert sum(delivered.values()) - len(wanted) <= kills * len(CHANNELS)
    assert all(letter.delivered is not None for letter in letters)


def journal(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []
