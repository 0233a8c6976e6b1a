"""A real server, as a process to be killed: what it does for a task is a line in a journal.

``python -m tests.missions.service.journal_server FOLDER`` ends when all tasks are done and all notices delivered. The
journal is a file that is only ever appended to: what stands in it was done, whatever became of the process then.
"""

import os
import sys
from contextlib import closing
from pathlib import Path

from drivers.clock import time_of_day
from missions.plugins.tasks.notice import Channel, Notice
from missions.plugins.tasks.notice_delivery import NoticeSender
from missions.plugins.tasks.outbox import Outbox
from missions.plugins.tasks.queue import TaskQueue
from missions.plugins.tasks.queue_database import open_db
from missions.plugins.tasks.run_process import Say, Stopping
from missions.plugins.tasks.task import AttemptOutcome, Claim
from missions.plugins.tasks.task_server import TaskServer

CHANNELS = ("one", "two")

PATIENCE = 300.0
"""Seconds for notices that are still to be delivered: thousands, at most."""


def main(folder: Path) -> None:
    """Serve the queue in ``folder`` until it is empty."""
    database, done, delivered = folder / "tasks.db", append_to(folder / "done"), append_to(folder / "delivered")

    def work(claim: Claim, stopping: Stopping, say: Say) -> AttemptOutcome:
        del stopping, say
        os.write(done, b"%d\n" % claim.attempt)
        return AttemptOutcome("success")

    def channel_of(name: str) -> Channel:
        def take(notice: Notice) -> None:
            os.write(delivered, f"{name} {notice.id}\n".encode())

        return take

    def now() -> float:
        return time_of_day().timestamp()

    with closing(open_db(database)) as connection, NoticeSender(database, channel_of, now, print) as courier:
        TaskServer(TaskQueue(connection, lambda _: CHANNELS), work, now, lambda _: None).run(once=True)
        courier.flush(PATIENCE)
        assert Outbox(connection).pending_count() == 0


def append_to(path: Path) -> int:
    """Open a file that every line goes to whole."""
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
