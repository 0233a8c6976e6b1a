"""The task server: takes tasks from the queue, runs them one at a time, and stores the results."""

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
"""Seconds between two checks of the queue; a new task begins within that time."""

T = TypeVar("T")


class TaskServer:
    """Runs the due tasks of the ``queue`` in order, one at a time.

    ``run`` blocks; ``stop`` may be called on any thread. No other server may serve the same queue. ``work`` runs one
    task. ``now`` returns Unix time, ``report`` prints a text for people. No task begins while ``is_held`` returns True.
    ``explain`` returns the text for a database error.
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
        self._pause = Event()  # never set: a signal handler must not take its lock
        self._stopping = False
        self._last_error = ""

    def stop(self, reason: str) -> None:
        """Stop the present run safely, then the server. Takes no lock, so a signal handler may call it."""
        del reason
        self._stopping = True

    def run(self, *, once: bool = False) -> None:
        """Serve until ``stop``; with ``once``, until no task is due or waits for a retry."""
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
        if self._stopping and outcome.how in ("interrupted", "cancelled"):
            reason = f"the server was stopped{': ' if outcome.reason else ''}{outcome.reason}"
            outcome = AttemptOutcome("interrupted", reason, stopped=True)
        # If this cannot be written either, the next server finds the attempt without an end.
        self._retry_until_stored(lambda: self._queue.finish(claim, outcome, self._now()))

    def _retry_until_stored(self, action: Callable[[], T]) -> T | None:
        """Return the result of ``action``, a function of the queue. While the disk is full, try again.

        Return None if the server is stopped meanwhile.
        """
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
