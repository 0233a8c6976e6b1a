"""Whatever is asked of the queue, and at whichever statement the program dies: nothing is lost, nothing is done twice.

A crash is a connection that works no more from some statement on, before or after it, and is dropped with whatever
transaction was open.
"""

import sqlite3
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any, NoReturn

import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, initialize, invariant, precondition, rule

from missions.plugins.tasks.queue_database import open_db, prepare
from missions.plugins.tasks.task import AttemptOutcome, Claim, How, NewTask, RetryPolicy, State, TaskError
from tests.missions.service.small_queue import BERLIN, CHANNELS, START, Shop, new

pytestmark = pytest.mark.long


class CrashError(BaseException):
    """The program has died."""


class Mortal(sqlite3.Connection):
    """A connection that dies: ``left`` statements are done before that, None for all; ``after`` the next, or before."""

    left: int | None = None
    after = False

    def execute(self, *arguments: Any) -> sqlite3.Cursor:
        if self.left is None:
            return super().execute(*arguments)
        self.left -= 1
        if self.left < 0 and not self.after:
            self.die()
        done = super().execute(*arguments)
        if self.left < 0:
            done.close()
            self.die()
        return done

    def die(self) -> NoReturn:
        """Drop what was not committed, as the next program finds it."""
        self.left = None
        if self.in_transaction:
            self.rollback()
        raise CrashError


ENDED = ("done", "failed", "cancelled", "given_up")

CRASHES = st.one_of(st.none(), st.tuples(st.integers(0, 10), st.booleans()))
"""None, or after how many statements, and whether the one after them is done."""

POLICIES = st.builds(RetryPolicy, st.sampled_from(["retry", "give-up"]), st.integers(1, 3), st.integers(0, 2))

HOWS = st.sampled_from(["success", "failure", "error", "interrupted"])


class Days(RuleBasedStateMachine):
    """A queue in the hands of people and of servers that die."""

    tasks = Bundle[int]("tasks")

    @initialize()
    def open(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.path = Path(self.folder.name) / "tasks.db"
        open_db(self.path).close()
        self.now = START
        self.running: Claim | None = None
        self.known: dict[int, State] = {}
        self.begin()

    def begin(self) -> None:
        """A program begins."""
        self.connection = sqlite3.connect(self.path, isolation_level=None, factory=Mortal)
        prepare(self.connection, self.path)
        self.connection.execute("PRAGMA synchronous = OFF")  # programs die here, the disk does not
        self.shop = Shop(self.connection, BERLIN)

    def do(self, crash: tuple[int, bool] | None, action: Any) -> Any:
        """Do something; None where the program dies of it, after which the next one recovers."""
        self.now += 1.0
        if crash is not None:
            self.connection.left, self.connection.after = crash
        try:
            return action()
        except CrashError:
            self.connection.close()
            self.begin()
            self.shop.queue.recover(self.now)
            self.running = None
            return None
        finally:
            self.connection.left = None

    @rule(
        target=tasks,
        crash=CRASHES,
        policy=POLICIES,
        every=st.sampled_from(["", "100 s", "day 12:00"]),
        priority=st.integers(-1, 1),
        timed=st.booleans(),
    )
    def add(self, crash: tuple[int, bool] | None, policy: RetryPolicy, every: str, priority: int, timed: bool) -> int:
        task: NewTask = new(due=self.now if timed else 0.0, every=every, policy=policy, priority=priority)
        number: int | None = self.do(crash, lambda: self.shop.queue.add(task, self.now))
        if number is not None:
            assert number not in self.known
            self.known[number] = "waiting"
        return number or 0

    @precondition(lambda self: self.running is None)
    @rule(crash=CRASHES)
    def claim(self, crash: tuple[int, bool] | None) -> None:
        self.running = self.do(crash, lambda: self.shop.queue.claim(self.now))
        if self.running is not None:
            self.known[self.running.task.id] = "running"

    @precondition(lambda self: self.running is not None)
    @rule(crash=CRASHES, how=HOWS)
    def finish(self, crash: tuple[int, bool] | None, how: How) -> None:
        claim = self.running
        assert claim is not None
        task = self.do(crash, lambda: self.shop.queue.finish(claim, AttemptOutcome(how), self.now))
        self.running = None
        if task is not None:
            self.known[task.id] = task.state
            assert (task.state == "done") == (how == "success")

    @rule(crash=CRASHES, number=tasks)
    def cancel(self, crash: tuple[int, bool] | None, number: int) -> None:
        try:
            state = self.do(crash, lambda: self.shop.queue.cancel(number, self.now))
        except TaskError:
            assert number == 0 or self.shop.queue.task(number).has_ended
        else:
            if state is not None:
                self.known[number] = state

    @precondition(lambda self: self.running is None)
    @rule(crash=CRASHES, how=HOWS)
    def run(self, crash: tuple[int, bool] | None, how: How) -> None:
        """Claim, and finish where there is something to: what happens most."""
        self.claim(None)
        if self.running is not None:
            self.finish(crash, how)

    @rule(hours=st.integers(0, 30))
    def wait(self, hours: int) -> None:
        self.now += hours * 3600.0

    @rule(hours=st.integers(1, 100))
    def put_the_clock_back(self, hours: int) -> None:
        self.now -= hours * 3600.0

    @invariant()
    def nothing_is_lost_or_done_twice(self) -> None:
        tasks = {task.id: task for task in self.shop.queue.tasks()}
        assert self.known.keys() <= tasks.keys()
        for number, state in self.known.items():
            if state in ENDED:
                assert tasks[number].state == state, "what has ended stays so"
        for task in tasks.values():
            hows = [attempt.how for attempt in self.shop.queue.attempts(task.id)]
            assert len(hows) == task.attempts
            assert hows.count("success") == (task.state == "done")
            assert (None in hows) == (task.state == "running")
        assert sum(task.state == "running" for task in tasks.values()) == (self.running is not None)

    @invariant()
    def each_end_is_told_to_every_channel_once(self) -> None:
        for task in self.shop.queue.tasks():
            ended = sum(attempt.ended is not None for attempt in self.shop.queue.attempts(task.id))
            told = Counter(letter.channel for letter in self.shop.outbox.notices_of(task.id))
            assert told == Counter(dict.fromkeys(CHANNELS, ended) if ended else {})

    @invariant()
    def a_repetition_goes_on_until_it_is_cancelled_and_is_there_once(self) -> None:
        series: dict[int, list[Any]] = {}
        for task in self.shop.queue.tasks():
            if task.series is not None:
                series.setdefault(task.series, []).append(task)
        for tasks in series.values():
            live = [task for task in tasks if not task.has_ended]
            stopped = any(task.state == "cancelled" or task.cancelling for task in tasks)
            assert len(live) <= 1
            assert bool(live) != stopped or [task.state for task in live] == ["running"]
            assert len({task.due for task in tasks}) == len(tasks)

    def teardown(self) -> None:
        if hasattr(self, "connection"):
            self.connection.close()
            self.folder.cleanup()


TestDays = Days.TestCase

# To shrink what fails would take longer than a test may.
PHASES = (Phase.explicit, Phase.reuse, Phase.generate)

TestDays.settings = settings(max_examples=40, stateful_step_count=40, deadline=None, phases=PHASES)
