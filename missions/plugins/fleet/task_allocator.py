"""Allocation of fleet tasks: each task goes to a free robot, and to another one if that robot is lost."""

import hashlib
import json
import sqlite3
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields

from config.units import Quantity
from missions.language.expressions import ExpressionError, parse
from missions.library.shipped import MISSION_NAME
from missions.plugins.fleet.messages import (  # fmt: skip
    MAX_ANSWER_BYTES,
    MAX_TEXT_LENGTH,
    TASK_ID_PATTERN,
    AcceptTask,
    Address,
    AttemptEnd,
    DecideTask,
    FleetAnswer,
    FleetRequest,
    FleetTaskInfo,
    FleetTimeouts,
    KeepTask,
    ListFleetTasks,
    RobotState,
    TaskReport,
    TaskState,
)
from missions.plugins.fleet.task_executor import SendRequest
from missions.plugins.fleet.zenoh_transport import Roster, RosterEntry
from missions.plugins.tasks.notice import from_row, row_of
from missions.plugins.tasks.task import Interrupted, RetryPolicy, is_due

# Tasks that a robot manages for its fleet: their robots and results.
#
# One robot manages a task from its addition to its end, and alone decides which robot runs it:
# so no leader is needed. Data that must not be lost is stored before the answer is sent.

RETRY_INTERVAL = 5.0
"""Seconds between a failed attempt to run a fleet task and the next attempt."""

DOUBT_REASON = "its progress is unknown, and it must not run twice"


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetTask:
    """A fleet task as its allocator stores it: for the robot ``on`` (`any` for all) that meets the condition ``where``.

    ``robot`` is the address of the robot that has the task, ``attempt`` the number of its attempt. Once ``confirmed``
    is True, the robot may have begun the task.
    """

    id: str
    mission: str
    params: Mapping[str, str] = field(default_factory=dict)
    on: str = "any"
    where: str = ""
    if_interrupted: Interrupted = "retry"
    retries: int = 0
    by: str = ""
    added: float = 0.0
    state: TaskState = "WAITING"
    robot: str = ""
    attempt: int = 0
    confirmed: bool = False
    failures: int = 0
    interruptions: int = 0
    not_before: float = 0.0
    reason: str = ""

    @property
    def has_ended(self) -> bool:
        """Whether the state of the task is final."""
        return self.state in ("FINISHED", "FAILED")

    def is_due(self, now: float) -> bool:
        """Return whether the waiting time before the next attempt is over at ``now``."""
        return is_due(self.not_before, now, RETRY_INTERVAL)


def changes_after(task: FleetTask, how: AttemptEnd, reason: str, now: float) -> Mapping[str, object]:
    """Return the fields of a task that change after an attempt with the result ``how``, by the task's retry policy."""
    counts: dict[str, object] = {}
    match how:
        case "interrupted":
            counts = {"interruptions": task.interruptions + 1}
        case "failure":
            counts = {"failures": task.failures + 1, "not_before": now + RETRY_INTERVAL}
    policy = RetryPolicy(task.if_interrupted, retries=task.retries)
    match policy.verdict(how, task.failures, task.interruptions):
        case "done":
            return {"state": "FINISHED", "reason": reason}
        case "again":
            return {"state": "WAITING", "robot": "", "confirmed": False, "reason": reason, **counts}
        case _:
            doubt = f"{reason}; {DOUBT_REASON}" if how == "interrupted" and policy.interrupted == "give-up" else reason
            return {"state": "FAILED", "reason": doubt, **counts}


class TaskStore:
    """Fleet tasks in a database of ``queue_database.open_db``, for one thread. Each change is on the disk on return."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def add(self, task: FleetTask) -> FleetTask:
        """Add a task unless its ID exists; return the stored task."""
        row = row_of(task)
        names, marks = ", ".join(f'"{name}"' for name in row), ", ".join("?" * len(row))
        self._connection.execute(f"INSERT OR IGNORE INTO kept ({names}) VALUES ({marks})", list(row.values()))  # noqa: S608
        return self.get(task.id) or task

    def get(self, number: str) -> FleetTask | None:
        """Return a task by its ID, or None."""
        row = self._connection.execute("SELECT * FROM kept WHERE id = ?", (number,)).fetchone()
        return None if row is None else from_row(FleetTask, row)

    def open_tasks(self) -> list[FleetTask]:
        """Return the tasks that are neither finished nor failed, oldest first."""
        sql = "SELECT * FROM kept WHERE state NOT IN ('FINISHED', 'FAILED') ORDER BY rowid"
        return [from_row(FleetTask, row) for row in self._connection.execute(sql)]

    def newest(self, *, ended: bool, before: str = "") -> Iterator[FleetTask]:
        """Yield open or ended tasks, newest first, starting after the task with the ID ``before``."""
        sql = f"""SELECT * FROM kept WHERE state {"" if ended else "NOT"} IN ('FINISHED', 'FAILED')
            AND (? = '' OR rowid < (SELECT rowid FROM kept WHERE id = ?)) ORDER BY rowid DESC"""  # noqa: S608
        return (from_row(FleetTask, row) for row in self._connection.execute(sql, (before, before)))

    def change(self, number: str, changes: Mapping[str, object]) -> None:
        """Change fields of a task; a database trigger refuses to change the state of a task that has ended."""
        names = ", ".join(f'"{name}" = ?' for name in changes)
        self._connection.execute(f"UPDATE kept SET {names} WHERE id = ?", [*changes.values(), number])  # noqa: S608


MAX_OPEN_TASKS = 10_000
"""Maximum number of open fleet tasks that one robot allocates."""

MAX_PAGE_TASKS = 500
"""Maximum number of tasks in an answer; an operator requests older ones page by page."""

MAX_PAGE_BYTES = MAX_ANSWER_BYTES - 64 * 1024
"""Maximum size of the tasks in an answer, in bytes; a longer answer would be refused by its reader."""

LATE_PREFIX = "done, while the robot was unreachable, by"

LOST_REASON = "its robot is unreachable"


class TaskAllocator:
    """A FleetService that stores tasks and decides which robot runs each. Runs on the member's thread."""

    def __init__(
        self,
        address: Address,
        store: TaskStore,
        roster: Roster,
        send_request: SendRequest,
        now: Callable[[], float],
        wall: Callable[[], float],
        timeouts: FleetTimeouts | None = None,
    ) -> None:
        self._address, self._store, self._roster, self._send_request = address, store, roster, send_request
        self._now, self._wall, self._timeouts = now, wall, timeouts or FleetTimeouts()
        self.is_duplicate: Callable[[], bool] = lambda: False
        """Function that returns whether another robot has the same address; if so, this robot allocates nothing."""
        self._begun_at = now()
        self._contact_at: dict[str, float] = {}
        self._sent_at: dict[str, float] = {}
        self._refused_until: dict[tuple[str, str], float] = {}
        self._answers: deque[tuple[str, int, str, FleetAnswer | None]] = deque()

    # --- what is asked ----------------------------------------------------------------------------------------------

    def answer(self, request: FleetRequest) -> FleetAnswer | None:
        """Answer requests about the tasks that this robot allocates; return None for any other request."""
        match request:
            case KeepTask():
                return self._keep(request)
            case TaskReport():
                return self._report(request)
            case DecideTask():
                return self._decide(request)
            case ListFleetTasks():
                return self._page(request)
        return None

    def _page(self, ask: ListFleetTasks) -> FleetAnswer:
        """Return as many tasks as fit into one answer."""
        entries: list[Mapping[str, object]] = []
        size = 0
        for task in self._store.newest(ended=ask.ended, before=ask.before):
            size += len(json.dumps(entry := _task_info(task))) + 1
            if size > MAX_PAGE_BYTES or len(entries) >= MAX_PAGE_TASKS:
                break
            entries.append(entry)
        return FleetAnswer(data=tuple(entries))

    def _keep(self, ask: KeepTask) -> FleetAnswer:
        if not TASK_ID_PATTERN.fullmatch(ask.task) or not ask.task.startswith(f"{self._address}/"):
            return FleetAnswer(ok=False, reason=f"'{ask.task}' is not the ID of a task that {self._address} manages")
        if self.is_duplicate():
            return FleetAnswer(ok=False, reason=f"another robot has the same number {self._address.number}")
        if not MISSION_NAME.fullmatch(ask.mission):
            return FleetAnswer(ok=False, reason=f"'{ask.mission}' is not the name of a library mission")
        if ask.where:
            try:
                condition = parse(ask.where)
            except ExpressionError as error:
                return FleetAnswer(ok=False, reason=str(error)[:300])
            if condition.draws:
                return FleetAnswer(ok=False, reason="'random' has values only in the run of a mission")
        if len(self._store.open_tasks()) >= MAX_OPEN_TASKS:
            return FleetAnswer(ok=False, reason=f"{MAX_OPEN_TASKS} tasks are waiting already")
        values = {each.name: getattr(ask, each.name) for each in fields(ask) if each.name not in {"task", "by"}}
        kept = self._store.add(FleetTask(id=ask.task, by=ask.by, added=self._wall(), **values))
        if any(getattr(kept, name) != value for name, value in values.items()):
            return FleetAnswer(ok=False, reason=f"{ask.task} is another task: {kept.mission} on {kept.on}")
        return FleetAnswer()

    def _report(self, ask: TaskReport) -> FleetAnswer:
        """Store the state of an attempt that a robot reports.

        The answer is negative if the robot no longer has the task.
        """
        task, final = self._store.get(ask.task), ask.state in ("FINISHED", "FAILED")
        drop = FleetAnswer(ok=False, reason="another robot has it now", data=({"drop": True},))
        if task is None:
            return FleetAnswer() if final else drop
        if (task.robot, task.attempt) != (ask.robot, ask.attempt):
            return self._record_late_finish(task, ask) or drop
        if task.has_ended:
            return FleetAnswer() if final else drop
        self._contact_at[task.id] = self._now()
        if final:
            how = ask.how or "failure"
            self._change(task, changes_after(task, how, ask.reason, self._wall()))
        elif not task.confirmed or task.state != ask.state:
            self._change(task, {"state": ask.state, "confirmed": True, "reason": ""})
        return FleetAnswer()

    def _change(self, task: FleetTask, changes: Mapping[str, object]) -> None:
        """Store ``changes`` of fields of a task.

        If they change the reason, notes in the old reason about robots that finished the task late are kept.
        """
        if "reason" in changes:
            reason = str(changes["reason"])
            also = [each for each in task.reason.split("; ") if each.startswith(LATE_PREFIX) and each not in reason]
            changes = {**changes, "reason": "; ".join(each for each in (reason, *also) if each)}
        self._store.change(task.id, changes)

    def _record_late_finish(self, task: FleetTask, ask: TaskReport) -> FleetAnswer | None:
        """Record that a robot has finished a task although it was meanwhile given to another robot.

        Return the answer to the report, or None if it reports anything else.
        """
        if ask.state != "FINISHED":
            return None
        note = f"{LATE_PREFIX} {ask.robot}"
        if not task.has_ended and not task.confirmed:  # no other robot has begun it
            self._change(task, {"state": "FINISHED", "reason": note})
        elif note not in task.reason:
            self._change(task, {"reason": f"{task.reason}; {note}".removeprefix("; ")})
        return FleetAnswer()

    def _decide(self, ask: DecideTask) -> FleetAnswer:
        """Apply a person's decision about a task whose robot is lost."""
        task = self._store.get(ask.task)
        if task is None or task.has_ended:
            return FleetAnswer(ok=False, reason=f"task {ask.task} is not managed here, or has ended")
        if ask.decision == "give-up":
            self._change(task, {"state": "FAILED", "reason": f"given up by {ask.by}"})
        elif not task.robot:
            return FleetAnswer(ok=False, reason=f"task {ask.task} is already waiting for a robot")
        else:
            changes = {"state": "WAITING", "robot": "", "confirmed": False, "reason": f"reassigned by {ask.by}"}
            self._change(task, changes)
        return FleetAnswer(reason="done")

    # --- what is due ------------------------------------------------------------------------------------------------

    def step(self, now: float) -> bool:
        """Assign waiting tasks and check assigned ones.

        Return True while a task is open, so that the next call is due soon.
        """
        while self._answers:
            self._on_offer_answer(*self._answers.popleft(), now)
        if self.is_duplicate():
            return False
        tasks = self._store.open_tasks()
        taken = {each.robot for each in tasks}
        members = self._roster.members()
        for task in tasks:
            if not task.robot:
                if task.is_due(self._wall()) and (found := self._choose_robot(task, members, taken, now)):
                    taken.add(str(found))
                    changes = {"robot": str(found), "attempt": task.attempt + 1, "confirmed": False}
                    self._change(task, changes)  # before it is sent, so that its robot is always known
                    self._offer(task, found, task.attempt + 1, now)
                continue
            self._check_assigned(task, Address.read(task.robot), members, now)
        return bool(tasks)

    def _check_assigned(
        self, task: FleetTask, robot: Address, members: Mapping[Address, RosterEntry], now: float
    ) -> None:
        """Repeat the offer of a task that its robot has not confirmed, or reassign the task of a lost robot."""
        is_offline = robot not in members or members[robot].connection != "ONLINE"
        if not task.confirmed:
            if (
                is_offline and now > self._begun_at + self._timeouts.retry_interval
            ):  # it cannot have begun, since a begin needs a confirmation
                self._change(task, {"robot": ""})
            elif not is_offline and now > self._sent_at.get(task.id, self._begun_at) + self._timeouts.retry_interval:
                self._offer(task, robot, task.attempt, now)
        elif now > self._contact_at.get(task.id, self._begun_at) + self._timeouts.reassign_after:
            if task.if_interrupted == "retry":
                self._change(task, {"state": "WAITING", "robot": "", "confirmed": False, "reason": LOST_REASON})
            elif not task.reason.startswith(LOST_REASON):
                self._change(task, {"reason": LOST_REASON})

    def _choose_robot(
        self, task: FleetTask, members: Mapping[Address, RosterEntry], taken: set[str], now: float
    ) -> Address | None:
        """Return a free robot that meets the task's condition, or None.

        Robots are tried in an order that is different for each task, so that allocators seldom choose the same robot.
        """
        found = [
            address
            for address, each in members.items()
            if each.is_online
            and each.state is not None
            and each.state.free
            and str(address) not in taken
            and task.on in ("any", address.name)
            and now > self._refused_until.get((task.id, str(address)), 0.0)
            and matches_condition(task.where, address, each.state)
        ]
        return min(found, default=None, key=lambda each: hashlib.sha256(f"{task.id} {each}".encode()).digest())

    def _offer(self, task: FleetTask, robot: Address, attempt: int, now: float) -> None:
        self._sent_at[task.id] = now
        again = task.if_interrupted == "retry"
        accept = AcceptTask(task=task.id, attempt=attempt, mission=task.mission, params=task.params, repeatable=again)
        self._send_request(accept, robot, lambda answer: self._answers.append((task.id, attempt, str(robot), answer)))

    def _on_offer_answer(self, number: str, attempt: int, robot: str, answer: FleetAnswer | None, now: float) -> None:
        """Process a robot's answer to an offered task; after a refusal, the task waits for another robot."""
        task = self._store.get(number)
        if answer is None or answer.ok or task is None or task.confirmed or task.has_ended:
            return
        if (task.robot, task.attempt) != (robot, attempt):
            return
        unable = bool(answer.data)
        self._refused_until[number, robot] = now + (60.0 if unable else self._timeouts.refusal_pause)
        self._change(task, {"robot": "", "reason": f"{robot}: {answer.reason}" if unable else ""})


def matches_condition(where: str, address: Address, state: RobotState) -> bool:
    """Return whether a robot meets a condition; a condition that reads an unknown value is not met."""
    if not where:
        return True
    known: dict[str, tuple[object, str]] = {
        "battery": (state.battery, "share"), "x": (state.x, "length"), "y": (state.y, "length"),
    }  # fmt: skip
    scope: dict[str, object] = {
        name: Quantity(value, unit) for name, (value, unit) in known.items() if isinstance(value, int | float)
    }
    scope |= {"name": address.name, "robot": state.robot, "parts": list(state.parts), "simulated": state.simulated}
    try:
        return parse(where).evaluate(scope) is True
    except ExpressionError:
        return False


def _task_info(task: FleetTask) -> Mapping[str, object]:
    """Return the fields of a task as a FleetTaskInfo, with the reason cut to the maximum length of a text."""
    values = {each.name: getattr(task, each.name) for each in fields(FleetTaskInfo)}
    return values | {"reason": task.reason[:MAX_TEXT_LENGTH]}
