"""The server: takes one task after another from the queue, has it done, and keeps what came of it."""

import sqlite3
from collections.abc import Callable
from functools import partial
from itertools import count
from threading import Event
from typing import TypeVar

from missions.plugins.tasks.queue import TaskQueue
from missions.plugins.tasks.run_process import Work
from missions.plugins.tasks.task import AttemptOutcome, Claim

POLL_INTERVAL = 0.5
"""Seconds from one look into the queue to the next: a task that is added begins within that time."""

T = TypeVar("T")


class TaskServer:
    """Does what is due, in order, one task at a time; ``run`` it on one thread, ``stop`` it from any.

    Only while nobody else serves the same ``queue``. ``now`` is the wall clock (Unix), ``tell`` hears what people
    should know. While ``held`` says so, nothing begins. ``explain`` says of a queue that cannot be used what to do.
    """

    def __init__(
        self,
        queue: TaskQueue,
        work: Work,
        now: Callable[[], float],
        report: Callable[[str], None],
        *,
        is_held: Callable[[], bool] = lambda: False,
        explain: Callable[[sqlite3.OperationalError], str] = str,
    ) -> None:
        self._queue, self._work, self._now, self._report = queue, work, now, report
        self._is_held, self._explain = is_held, explain
        self._pause = Event()  # nobody sets it: a signal handler, which stops the server, must take no lock
        self._stopping = False
        self._last_error = ""

    def stop(self, reason: str) -> None:
        """End the run that goes on, safely, and then the server. The one call that a signal handler may make."""
        del reason
        self._stopping = True

    def run(self, *, once: bool = False) -> None:
        """Serve until told to stop; with ``once``, until nothing is due, nor to be tried again."""
        self._retry_until_stored(lambda: self._queue.recover(self._now()))
        while not self._stopping:
            now = self._now()
            claim = None if self._is_held() else self._retry_until_stored(partial(self._queue.claim, now))
            if claim is not None:
                self._run_task(claim)
            elif once and not self._retry_until_stored(partial(self._queue.has_pausing_task, now)):
                return
            else:
                self._pause.wait(POLL_INTERVAL)

    def _run_task(self, claim: Claim) -> None:
        task, numbers = claim.task, count(1)
        self._report(f"task {task.id}: {task.name} begins" + (f", attempt {claim.number}" if claim.number > 1 else ""))

        def stopping() -> bool:
            return self._stopping or bool(self._retry_until_stored(lambda: self._queue.is_cancelling(claim)))

        def say(text: str) -> None:
            number = next(numbers)
            self._retry_until_stored(lambda: self._queue.post_message(claim, number, text, self._now()))

        try:
            outcome = self._work(claim, stopping, say)
        except OSError as error:
            outcome = AttemptOutcome("error", f"no process could be started: {error}")
        if self._stopping and outcome.how == "interrupted":
            reason = f"the server was stopped{': ' if outcome.reason else ''}{outcome.reason}"
            outcome = AttemptOutcome("interrupted", reason, stopped=True)
        # Where even this cannot be written before the end, the next server finds the attempt without an end.
        self._retry_until_stored(lambda: self._queue.finish(claim, outcome, self._now()))

    def _retry_until_stored(self, action: Callable[[], T]) -> T | None:
        """Do something with the queue; where its disk is full, again until there is room, or the server is to stop."""
        while True:
            try:
                result = action()
            except sqlite3.OperationalError as error:
                if str(error) != self._last_error:
                    self._last_error = str(error)
                    self._report(f"the queue cannot be used: {self._explain(error)}")
                if self._stopping:
                    return None
                self._pause.wait(POLL_INTERVAL)
            else:
                if self._last_error:
                    self._report("the queue can be used again")
                self._last_error = ""
                return result
