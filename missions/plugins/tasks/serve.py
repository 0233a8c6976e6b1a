"""The server: takes one task after another from the queue, has it done, and keeps what came of it."""

import sqlite3
from collections.abc import Callable
from functools import partial
from itertools import count
from threading import Event
from typing import TypeVar

from missions.plugins.tasks.queue import Queue
from missions.plugins.tasks.task import Claim, Outcome
from missions.plugins.tasks.work import Work

PERIOD = 0.5
"""Seconds from one look into the queue to the next: a task that is added begins within that time."""

T = TypeVar("T")


class Server:
    """Does what is due, in order, one task at a time; ``run`` it on one thread, ``stop`` it from any.

    Only while nobody else serves the same ``queue``. ``now`` is the wall clock (Unix), ``tell`` hears what people
    should know. While ``held`` says so, nothing begins. ``explain`` says of a queue that cannot be used what to do.
    """

    def __init__(
        self,
        queue: Queue,
        work: Work,
        now: Callable[[], float],
        tell: Callable[[str], None],
        *,
        held: Callable[[], bool] = lambda: False,
        explain: Callable[[sqlite3.OperationalError], str] = str,
    ) -> None:
        self._queue, self._work, self._now, self._tell = queue, work, now, tell
        self._held, self._explain = held, explain
        self._pause = Event()  # nobody sets it: a signal handler, which stops the server, must take no lock
        self._stopping = False
        self._trouble = ""

    def stop(self, reason: str) -> None:
        """End the run that goes on, safely, and then the server. The one call that a signal handler may make."""
        del reason
        self._stopping = True

    def run(self, *, once: bool = False) -> None:
        """Serve until told to stop; with ``once``, until nothing is due, nor to be tried again."""
        self._written(lambda: self._queue.recover(self._now()))
        while not self._stopping:
            now = self._now()
            claim = None if self._held() else self._written(partial(self._queue.claim, now))
            if claim is not None:
                self._do(claim)
            elif once and not self._written(partial(self._queue.pauses, now)):
                return
            else:
                self._pause.wait(PERIOD)

    def _do(self, claim: Claim) -> None:
        task, numbers = claim.task, count(1)
        self._tell(f"task {task.id}: {task.name} begins" + (f", attempt {claim.number}" if claim.number > 1 else ""))

        def stopping() -> bool:
            return self._stopping or bool(self._written(lambda: self._queue.cancelling(claim)))

        def say(text: str) -> None:
            number = next(numbers)
            self._written(lambda: self._queue.say(claim, number, text, self._now()))

        try:
            outcome = self._work(claim, stopping, say)
        except OSError as error:
            outcome = Outcome("error", f"no process could be started: {error}")
        if self._stopping and outcome.how == "interrupted":
            reason = f"the server was stopped{': ' if outcome.reason else ''}{outcome.reason}"
            outcome = Outcome("interrupted", reason, stopped=True)
        # Where even this cannot be written before the end, the next server finds the attempt without an end.
        self._written(lambda: self._queue.finish(claim, outcome, self._now()))

    def _written(self, action: Callable[[], T]) -> T | None:
        """Do something with the queue; where its disk is full, again until there is room, or the server is to stop."""
        while True:
            try:
                result = action()
            except sqlite3.OperationalError as error:
                if str(error) != self._trouble:
                    self._trouble = str(error)
                    self._tell(f"the queue cannot be used: {self._explain(error)}")
                if self._stopping:
                    return None
                self._pause.wait(PERIOD)
            else:
                if self._trouble:
                    self._tell("the queue can be used again")
                self._trouble = ""
                return result
