"""A queue in a file, whose clock the test owns, and the tasks that are put into it."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import datetime, tzinfo
from pathlib import Path
from zoneinfo import ZoneInfo

from missions.plugins.tasks.outbox import Outbox
from missions.plugins.tasks.queue import RETRY_INTERVAL, TaskQueue
from missions.plugins.tasks.queue_database import open_db
from missions.plugins.tasks.task import AttemptOutcome, Claim, How, NewTask, RetryPolicy, Task

BERLIN = ZoneInfo("Europe/Berlin")

START = datetime(2026, 11, 21, 12, 0, tzinfo=BERLIN).timestamp()

CHANNELS = ("home", "away")

RETRY = RetryPolicy("retry")


def new(
    mission: str = "greet",
    *,
    due: float = START,
    priority: int = 0,
    late: float | None = None,
    every: str = "",
    policy: RetryPolicy = RETRY,
) -> NewTask:
    params = {"to": "Ana"}
    return NewTask(mission=mission, params=params, due=due, priority=priority, late=late, every=every, policy=policy)


class Shop:
    """A queue with its outbox, at a time that goes on only when it is told."""

    def __init__(self, connection: sqlite3.Connection, zone: tzinfo = BERLIN) -> None:
        self.connection = connection
        self.queue = TaskQueue(connection, lambda _: CHANNELS, zone)
        self.outbox = Outbox(connection)
        self.now = START

    def add(self, task: NewTask) -> int:
        return self.queue.add(task, self.now)

    def claim(self) -> Claim:
        claim = self.queue.claim(self.now)
        assert claim is not None
        return claim

    def attempt(self, how: How, reason: str = "") -> Task:
        """Run what is due first; it ends like this a second later. Then the pause before another try is over."""
        claim = self.claim()
        self.now += 1.0
        task = self.queue.finish(claim, AttemptOutcome(how, reason), self.now)
        self.now += RETRY_INTERVAL
        return task

    def told(self, task: int, channel: str = "home") -> list[str]:
        return [letter.notice.text for letter in self.outbox.notices_of(task) if letter.channel == channel]

    def kinds(self, task: int, channel: str = "home") -> list[str]:
        return [letter.notice.kind for letter in self.outbox.notices_of(task) if letter.channel == channel]


@contextmanager
def shop(path: Path) -> Iterator[Shop]:
    with closing(open_db(path)) as connection:
        yield Shop(connection)
