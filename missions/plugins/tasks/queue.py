"""The task queue. Each change is one transaction, so that no crash loses or splits a task.

One transaction contains the end of an attempt, the new state of its task, the next repetition, and their notices.
"""

import json
import os
import re
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, time, timedelta, tzinfo
from pathlib import Path
from zoneinfo import ZoneInfo

from config.diagnostics import did_you_mean
from config.units import quantity_text, quoted_value, si_value
from drivers.clock import time_of_day
from missions.plugins.tasks import notice
from missions.plugins.tasks.notice import Notice, check_texts, from_row, row_of, to_new_task
from missions.plugins.tasks.queue_database import ORDER, checkpoint_log
from missions.plugins.tasks.task import Attempt, AttemptOutcome, Claim, How, NewTask, State, Task, TaskError, next_state

# Due times of tasks: times of day and repetitions as users write them, in local time.
#
# All functions except ``wall_clock`` depend only on their arguments, in Unix seconds. When clocks go forward, a
# skipped time means the moment of the change; when they go back, a repeated time means the first of
# the two.

DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")

MIN_INTERVAL = 1.0
"""Minimum seconds between two repetitions of a task."""

MAX_INTERVAL = 366 * 24 * 3600.0
"""Maximum seconds between two repetitions of a task: a year."""

_DATE_AND_TIME = re.compile(r"([0-9]{4}-[0-9]{2}-[0-9]{2})[ T]+([0-9]{1,2}:[0-9]{2})")


@dataclass(frozen=True, slots=True)
class Repetition:
    """Repetition of a task: every ``period`` seconds; if 0, at the time of day ``at``, daily or on one day of the week.

    ``day`` is the day of the week (0 is Monday), or None for every day.
    """

    period: float = 0.0
    day: int | None = None
    at: time = time()

    def __str__(self) -> str:
        if self.period:
            return f"{self.period:.12g} s"
        return f"{'day' if self.day is None else DAYS[self.day]} {self.at:%H:%M}"


def wall_clock() -> float:
    """Return the Unix time in seconds."""
    return time_of_day().timestamp()


def read_repetition(text: str, begin: float, zone: tzinfo, at: str = "") -> Repetition:
    """Parse "30 min", "day", "monday" or "day 18:00"; the time of day defaults to that of ``at``, else of ``begin``.

    ``begin`` may differ from ``at`` when daylight saving skips that time. Raises ValueError with a message for people.
    """
    word, _, clock = text.strip().lower().partition(" ")
    if word == "day" or word in DAYS:
        time_text = clock.strip() or at.strip()[-5:].strip(" T")
        when = _read_time(time_text) if time_text else datetime.fromtimestamp(begin, zone).time()
        return Repetition(day=None if word == "day" else DAYS.index(word), at=when.replace(second=0, microsecond=0))
    try:
        period = si_value(text, "duration")
    except ValueError as error:
        hint = did_you_mean(word, ("day", *DAYS)) or "such as '30 min', 'day' or 'monday 18:00'"
        raise ValueError(f"{quoted_value(text)} is not a repetition: {hint}") from error
    if period < MIN_INTERVAL:
        raise ValueError(f"{quoted_value(text)} is too often: at least {quantity_text(MIN_INTERVAL, 'duration')}")
    if period > MAX_INTERVAL:
        raise ValueError(f"{quoted_value(text)} is too rare: at most a year, {MAX_INTERVAL / 3600:g} h")
    return Repetition(period=period)


def first_time(every: Repetition, begin: float, zone: tzinfo) -> float:
    """Return the first due time of a repetition that begins at ``begin``."""
    return begin if every.period else _next_day(every, begin, zone, inclusive=True)


def next_time(every: Repetition, due: float, now: float, zone: tzinfo) -> float:
    """Return the first due time after both ``due`` and ``now``; missed repetitions are skipped."""
    if not every.period:
        return _next_day(every, max(due, now), zone)
    steps = max(1, int((now - due) // every.period) + 1)
    while (found := due + steps * every.period) <= max(due, now):  # rounding may leave it one step short
        steps += 1
    return found


def limit_ahead(every: Repetition, due: float, now: float, zone: tzinfo) -> float:
    """Return ``due``, or an earlier time if ``due`` is more than one repetition ahead since the clock was set back.

    The result is no later than the first time of a repetition that begins ``now``.
    """
    return min(due, now + every.period if every.period else _next_day(every, now, zone))


def read_at(text: str, now: float, zone: tzinfo) -> float:
    """Parse "18:00" (the next after ``now``) or "2026-12-24 18:00". Raises ValueError with a message for people."""
    found = _DATE_AND_TIME.fullmatch(text.strip())
    if found is None:
        return _next_day(Repetition(at=_read_time(text.strip())), now, zone)
    try:
        day = date.fromisoformat(found[1])
    except ValueError as error:
        raise ValueError(f"{quoted_value(text)} is not a date: {error}") from error
    due = _local_timestamp(day, _read_time(found[2]), zone)
    if due <= now:
        raise ValueError(
            f"{quoted_value(text)} is in the past: it is {datetime.fromtimestamp(now, zone):%Y-%m-%d %H:%M} now"
        )
    return due


def local_zone(environment: Mapping[str, str] = os.environ) -> tzinfo:
    """Return the time zone of this machine: that of TZ, else of /etc/localtime, else UTC."""
    name = environment.get("TZ", "").removeprefix(":")
    try:
        if name:
            return ZoneInfo(name)
        with Path("/etc/localtime").open("rb") as file:
            return ZoneInfo.from_file(file, key="local")
    except (OSError, ValueError, LookupError):
        return UTC


def _read_time(text: str) -> time:
    found = re.fullmatch("([0-9]{1,2}):([0-9]{2})", text)
    if found is None or int(found[1]) > 23 or int(found[2]) > 59:
        raise ValueError(f"{quoted_value(text)} is not a time of day such as '18:00', or '2026-12-24 18:00'")
    return time(int(found[1]), int(found[2]))


def _next_day(every: Repetition, after: float, zone: tzinfo, *, inclusive: bool = False) -> float:
    """Return the first daily or weekly time after ``after``; with ``inclusive``, ``after`` itself counts."""
    day = datetime.fromtimestamp(after, zone).date() - timedelta(days=1)
    while True:
        if every.day in (None, day.weekday()):
            found = _local_timestamp(day, every.at, zone)
            if found > after or (inclusive and found == after):
                return found
        day += timedelta(days=1)


def _local_timestamp(day: date, at: time, zone: tzinfo) -> float:
    """Return the Unix time of a local time: the first if it occurs twice, the end of the gap if it is skipped."""
    local = datetime.combine(day, at, zone)
    # In a gap, fold 0 is read as before the change and fold 1 as after it, so their order is reversed.
    early, late = sorted(local.replace(fold=fold).timestamp() for fold in (0, 1))
    if datetime.fromtimestamp(late, zone).replace(tzinfo=None) == datetime.combine(day, at) or early == late:
        return early
    before = datetime.fromtimestamp(early, zone).utcoffset()
    while late - early > 0.5:  # bisection: the change is at a whole second between them
        middle = (early + late) / 2
        if datetime.fromtimestamp(middle, zone).utcoffset() == before:
            early = middle
        else:
            late = middle
    return float(round(late))


RETRY_INTERVAL = 30.0
"""Seconds between the end of an attempt and the next one. Other tasks run meanwhile."""

_READY = "(not_before <= ?1 OR not_before > ?1 + ?2)"
"""SQL condition: a task's pause between attempts is over, or the clock was set back. ?1 is the time, ?2 the pause."""

_MISSED = "(late IS NOT NULL AND attempts = 0 AND ?1 > max(due, added) + late)"
"""SQL condition of tasks that were missed, with the present time as ?1.

The function ``_is_too_late`` tests the same condition on a task.
"""

DOWN_REASON = "the computer or the server went down"
"""Reason that is stored for an attempt without an end, which a server finds when it starts."""

Channels = Callable[[Task], Sequence[str]]
"""Function that returns the notice channels of a task as encoded texts."""


class TaskQueue:
    """Tasks in a database of ``queue_database.open_db``. Times are Unix times, passed as ``now``.

    ``zone`` is the time zone of daily repetitions. A method that raises has changed nothing.
    """

    def __init__(self, connection: sqlite3.Connection, channels: Channels, zone: tzinfo = UTC) -> None:
        self._connection = connection
        self._channels = channels
        self._zone = zone

    # --- what people ask of it ------------------------------------------------------------------------------------

    def add(self, new: NewTask, now: float) -> int:
        """Add a task; return its number. Raises TaskError for texts that cannot be stored."""
        check_texts(new)
        with self._transaction():
            number = self._insert(new, None, now)
            channels = json.dumps(list(self._channels(self.task(number))))
            self._execute("UPDATE task SET channels = ? WHERE id = ?", channels, number)
            if new.every:
                self._execute("UPDATE task SET series = id WHERE id = ?", number)
        return number

    def cancel(self, number: int, now: float) -> State:
        """Cancel a task and its repetition; return its state.

        A waiting task is cancelled at once. A running one is marked as ``cancelling``, and its server stops it. Raises
        TaskError for an unknown or ended task.
        """
        with self._transaction():
            task = self.task(number)
            if task.has_ended:
                raise TaskError(f"task {number} has already ended: it is {task.state}", hint="mission task list")
            if task.state == "running":
                self._execute("UPDATE task SET cancelling = 1 WHERE id = ?", number)
                return "running"
            self._settle(task, "cancelled", "it was cancelled", now)
            return "cancelled"

    def move(self, number: int, priority: int) -> None:
        """Set the priority of a waiting task. Raises TaskError for an unknown task, or one that does not wait."""
        with self._transaction():
            task = self.task(number)
            if task.state != "waiting":
                raise TaskError(f"task {number} is not waiting: it is {task.state}", hint="mission task list")
            self._execute("UPDATE task SET priority = ? WHERE id = ?", priority, number)

    def approve(self, number: int, now: float, by: str) -> None:
        """Approve a task; each repetition needs its own approval.

        Raises TaskError for an unknown task, one that does not wait, or one that needs no approval.
        """
        with self._transaction():
            task = self.task(number)
            if task.state != "waiting":
                raise TaskError(f"task {number} is not waiting: it is {task.state}", hint="mission task list")
            if not task.awaits_approval:
                raise TaskError(f"task {number} needs no approval", hint="mission task list")
            self._execute("UPDATE task SET approved = ?, approved_by = ? WHERE id = ?", now, by, number)

    def task(self, number: int) -> Task:
        """Return a task. Raises TaskError for an unknown one."""
        row = self._execute("SELECT * FROM task WHERE id = ?", number).fetchone()
        if row is None:
            raise TaskError(f"there is no task {number}", hint="mission task list --all")
        return from_row(Task, row)

    def tasks(self, *, ended: bool = True) -> list[Task]:
        """Return all tasks in the order in which they run; without ``ended``, only open ones."""
        which = "" if ended else " WHERE state IN ('waiting', 'running')"
        return [from_row(Task, row) for row in self._execute(f"SELECT * FROM task{which} ORDER BY {ORDER}")]  # noqa: S608 - ours

    def expected_time(self, task: Task, now: float) -> float:
        """Return the due time of a task, corrected for a clock that was set back."""
        if task.state == "waiting" and task.due > now and task.every and task.id != task.series:
            with suppress(ValueError, OverflowError):  # an invalid value from outside stays unchanged
                every = read_repetition(task.every, task.due, self._zone)
                return min(task.due, self._unused_time(task, every, limit_ahead(every, task.due, now, self._zone), now))
        return task.due

    def attempts(self, number: int) -> list[Attempt]:
        """Return the attempts at a task, in order."""
        rows = self._execute("SELECT * FROM attempt WHERE task = ? ORDER BY number", number)
        return [from_row(Attempt, row) for row in rows]

    # --- what the server asks of it -------------------------------------------------------------------------------

    def claim(self, now: float) -> Claim | None:
        """Start an attempt at the first due task; None if there is none. Tasks that are too late become missed."""
        self._limit_repetitions(now)
        if self._due(now) is None:  # the usual case, without a write
            return None
        with self._transaction():
            while (task := self._due(now)) is not None and _is_too_late(task, now):
                due_at = _clock_text(task.due_since, self._zone)
                reason = f"it was due at {due_at}, and does not begin more than {task.late:g} s later"
                self._settle(task, "given_up", reason, now)
                self._post(task, notice.missed_notice(task, reason, now), now)
            if task is None:
                return None
            self._execute("UPDATE task SET state = 'running', attempts = attempts + 1 WHERE id = ?", task.id)
            sql = "INSERT INTO attempt (task, number, began) VALUES (?, ?, ?)"
            attempt = self._execute(sql, task.id, task.attempts + 1, now).lastrowid
            return Claim(self.task(task.id), attempt or 0)

    def has_pausing_task(self, now: float) -> bool:
        """Return whether a due task waits for the end of the pause before its next attempt."""
        sql = f"SELECT 1 FROM task WHERE state = 'waiting' AND due <= ?1 AND NOT {_READY} LIMIT 1"  # noqa: S608 - ours
        return self._execute(sql, now, RETRY_INTERVAL).fetchone() is not None

    def finish(self, claim: Claim, outcome: AttemptOutcome, now: float) -> Task:
        """End an attempt; return the task afterwards.

        In the same transaction it stores the outcome, the new state of the task, its next repetition, and the notices.
        Raises TaskError if the attempt has ended already.
        """
        with self._transaction():
            return self._finish(claim.attempt, outcome, now, pause=0.0 if outcome.stopped else RETRY_INTERVAL)

    def recover(self, now: float) -> list[Task]:
        """End the attempts that a crash of the server left open; requeue or fail their tasks, and return them.

        Call it only while no task runs.
        """
        with self._transaction():
            # A task of a fleet needs a new confirmation: another robot may have it by now.
            errands = "SELECT task FROM errand WHERE told = 0"
            self._execute(f"UPDATE task SET approved = NULL WHERE state = 'waiting' AND id IN ({errands})")  # noqa: S608
            rows = self._execute("SELECT id FROM attempt WHERE ended IS NULL ORDER BY id").fetchall()
            return [self._finish(row["id"], AttemptOutcome("interrupted", DOWN_REASON), now, pause=0.0) for row in rows]

    def is_cancelling(self, claim: Claim) -> bool:
        """Return whether the running task is to be cancelled."""
        return self.task(claim.task.id).cancelling

    def post_message(self, claim: Claim, number: int, text: str, now: float) -> None:
        """Post the mission's ``number``-th message of this attempt as a notice."""
        with self._transaction():
            self._post(claim.task, notice.message_notice(claim.task, number, text, now), now)

    # --- inside a transaction -------------------------------------------------------------------------------------

    def _finish(self, attempt: int, outcome: AttemptOutcome, now: float, *, pause: float) -> Task:
        row = self._execute("SELECT task FROM attempt WHERE id = ? AND ended IS NULL", attempt).fetchone()
        if row is None:
            raise TaskError(f"attempt {attempt} has ended already")
        task = self.task(row["task"])
        how: How = "cancelled" if outcome.how == "interrupted" and task.cancelling else outcome.how
        sql = "UPDATE attempt SET ended = ?, how = ?, reason = ? WHERE id = ?"
        self._execute(sql, now, how, outcome.reason, attempt)
        sql = "UPDATE task SET failures = failures + ?, interruptions = interruptions + ?, not_before = ? WHERE id = ?"
        failed, interrupted = how in ("failure", "error"), how == "interrupted" and not outcome.stopped
        self._execute(sql, failed, interrupted, now + pause, task.id)
        state = next_state(task, how, stopped=outcome.stopped)
        self._settle(task, state, outcome.reason, now)
        self._post(task, notice.ended_notice(task, how, state, outcome.reason, now), now)
        return self.task(task.id)

    def _settle(self, task: Task, state: State, reason: str, now: float) -> None:
        """Set the state of a task; if it is final, add the next repetition, unless ``cancel`` has ended the task.

        A task whose run was stopped by a person is repeated.
        """
        was_ended = state in ("done", "failed", "given_up") or (state == "cancelled" and task.state == "running")
        if task.every and was_ended and not task.cancelling:
            try:
                every = read_repetition(task.every, task.due_since, self._zone)
                due = self._unused_time(task, every, next_time(every, task.due_since, now, self._zone), now)
            except (ValueError, OverflowError) as error:  # an invalid value from outside
                reason = f"{reason}{'; ' if reason else ''}it is not repeated: {error}"
            else:
                self._insert(replace(to_new_task(task), due=due), task.series, now)
        self._execute("UPDATE task SET state = ?, reason = ? WHERE id = ?", state, reason, task.id)

    def _limit_repetitions(self, now: float) -> None:
        """Bring the next tasks of repetitions nearer if they are too far ahead because the clock was set back."""
        sql = "SELECT * FROM task WHERE state = 'waiting' AND due > ? AND every <> '' AND id <> series"
        for row in self._execute(sql, now).fetchall():
            task = from_row(Task, row)
            if (due := self.expected_time(task, now)) < task.due:
                self._execute("UPDATE task SET due = ? WHERE id = ? AND state = 'waiting'", due, task.id)

    def _unused_time(self, task: Task, every: Repetition, due: float, now: float) -> float:
        """Return the first time of a repetition, from ``due`` on, for which its series has no task yet.

        If the clock was set back, there may already be tasks for the next times.
        """
        sql = "SELECT 1 FROM task WHERE series = ? AND due = ? AND id <> ?"
        while self._execute(sql, task.series, due, task.id).fetchone() is not None:
            due = next_time(every, due, now, self._zone)
        return due

    def _insert(self, new: NewTask, series: int | None, now: float) -> int:
        row = row_of(new) | {"added": now, "series": series}
        names, marks = ", ".join(row), ", ".join("?" * len(row))
        return self._execute(f"INSERT INTO task ({names}) VALUES ({marks})", *row.values()).lastrowid or 0  # noqa: S608

    def _post(self, task: Task, told: Notice, now: float) -> None:
        """Add a notice to the outbox once for each channel of the task."""
        sql = "INSERT INTO outbox (key, task, channel, body, added, next) VALUES (?, ?, ?, ?, ?, ?)"
        for channel in dict.fromkeys(self._channels(task)):
            self._execute(sql, told.id, task.id, channel, told.as_json(), now, now)

    def _due(self, now: float) -> Task | None:
        may = f"(NOT needs_approval OR approved IS NOT NULL OR {_MISSED})"  # a missed task is reported, approved or not
        sql = (
            f"SELECT * FROM task WHERE state = 'waiting' AND due <= ?1 AND {_READY} AND {may} ORDER BY {ORDER} LIMIT 1"  # noqa: S608 - ours
        )
        row = self._execute(sql, now, RETRY_INTERVAL).fetchone()
        return None if row is None else from_row(Task, row)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._execute("BEGIN IMMEDIATE")
        try:
            yield
            self._execute("COMMIT")
        except BaseException as error:
            if self._connection.in_transaction:
                self._connection.rollback()
            if isinstance(error, sqlite3.OperationalError):
                checkpoint_log(self._connection)
            raise

    def _execute(self, sql: str, *values: object) -> sqlite3.Cursor:
        return self._connection.execute(sql, values)


def _is_too_late(task: Task, now: float) -> bool:
    """Return whether a task was missed. A task that has begun in time never is, even if it was interrupted."""
    return task.late is not None and task.attempts == 0 and now > task.due_since + task.late


def _clock_text(time: float, zone: tzinfo) -> str:
    return f"{datetime.fromtimestamp(time, zone):%Y-%m-%d %H:%M}"
