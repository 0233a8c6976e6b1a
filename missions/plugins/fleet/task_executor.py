"""Execution of fleet tasks: accepted task IDs are stored beside the robot's own queue, which runs the tasks.

A task is on the disk before it is accepted. Before a task begins, the robot asks its allocator whether it still has the
task, and waits for the reply. So a delayed message starts nothing.
"""

import sqlite3
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from missions.plugins.fleet.fleet_robot import FleetRobot
from missions.plugins.fleet.member import RobotActivity
from missions.plugins.fleet.messages import (
    TASK_ID_PATTERN,
    AcceptTask,
    Address,
    AttemptEnd,
    FleetAnswer,
    FleetRequest,
    FleetTimeouts,
    TaskReport,
    TaskState,
)
from missions.plugins.tasks.queue import TaskQueue
from missions.plugins.tasks.task import NewTask, RetryPolicy, Task, TaskError

SendRequest = Callable[[FleetRequest, Address, Callable[[FleetAnswer | None], None]], None]
"""Function that sends a request to a robot, and later calls the callback with the answer, or None, on any thread."""

APPROVED_BY = "its keeper"


@dataclass(frozen=True, slots=True)
class TaskAssignment:
    """A fleet task that this robot has accepted: its ID, the number of the attempt, and the task in its own queue.

    ``again`` is True if the task may run a second time on another robot.
    """

    id: str
    attempt: int
    task: Task
    again: bool

    @property
    def allocator(self) -> Address:
        """Address of the robot that allocates this task."""
        return Address.read(self.id.rpartition("/")[0])


class AssignmentQueue(TaskQueue):
    """The robot's own queue, with a table of the tasks accepted from the fleet."""

    def accept(self, request: AcceptTask, robot: str, options: tuple[str, ...], now: float) -> None:
        """Add an accepted fleet task to the queue; it begins only after ``approve`` is called.

        Raises sqlite3.IntegrityError if this task is already accepted.
        """
        policy = RetryPolicy("give-up", most=1)  # its manager decides about retries
        new = NewTask(
            mission=request.mission,
            params=request.params,
            robot=robot,
            options=options,
            policy=policy,
            needs_approval=True,
        )
        with self._transaction():
            number = self._insert(new, None, now)
            sql = "INSERT INTO errand (id, attempt, task, again) VALUES (?, ?, ?, ?)"
            self._execute(sql, request.task, request.attempt, number, request.repeatable)

    def unconfirmed(self) -> list[TaskAssignment]:
        """Return the assignments whose end the allocator has not confirmed."""
        rows = self._execute("SELECT * FROM errand WHERE told = 0 ORDER BY task").fetchall()
        return [TaskAssignment(row["id"], row["attempt"], self.task(row["task"]), bool(row["again"])) for row in rows]

    def has_attempt(self, request: AcceptTask) -> bool:
        """Return whether this attempt to run the task was accepted before."""
        sql = "SELECT 1 FROM errand WHERE id = ? AND attempt = ?"
        return self._execute(sql, request.task, request.attempt).fetchone() is not None

    def mark_confirmed(self, assignment: TaskAssignment) -> None:
        """Store that the allocator has confirmed the end of an assignment, so that no more reports are needed."""
        self._execute("UPDATE errand SET told = 1 WHERE id = ? AND attempt = ?", assignment.id, assignment.attempt)

    def is_busy(self) -> bool:
        """Return whether a task of the queue is running."""
        return bool(self._execute("SELECT 1 FROM task WHERE state = 'running' LIMIT 1").fetchone())


@dataclass(slots=True)
class _ReportState:
    """State of the reports on one accepted task: the last report, its times, and the last confirmation."""

    reported: tuple[TaskState, AttemptEnd] | None = None
    sent_at: float = float("-inf")
    begun_at: float = 0.0
    answered: bool = False
    leased_at: float | None = None


class TaskExecutor:
    """A FleetService that accepts tasks and reports on them to their allocators.

    It cancels a task if its allocator has not answered for the time of its lease, since another robot may get it then.
    """

    def __init__(
        self,
        address: Address,
        queue: AssignmentQueue,
        fleet_robot: FleetRobot,
        send_request: SendRequest,
        now: Callable[[], float],
        wall: Callable[[], float],
        *,
        is_stopped: Callable[[], bool],
        robot: str = "",
        options: tuple[str, ...] = (),
        timeouts: FleetTimeouts | None = None,
        has_mission: Callable[[str], bool] = lambda _: True,
    ) -> None:
        self._address, self._queue, self._fleet_robot, self._send_request = address, queue, fleet_robot, send_request
        self._now, self._wall, self._is_stopped, self._has_mission = now, wall, is_stopped, has_mission
        self._robot, self._options, self._timeouts = robot, options, timeouts or FleetTimeouts()
        self._report_states: dict[tuple[str, int], _ReportState] = {}
        self._answers: deque[tuple[TaskAssignment, tuple[TaskState, AttemptEnd], float, FleetAnswer | None]] = deque()

    def activity(self) -> RobotActivity:
        """Return the robot's fleet task, its state, and whether the robot accepts another task."""
        open_ones = [each for each in self._queue.unconfirmed() if not each.task.has_ended]
        if not open_ones:
            return RobotActivity(free=not self._queue.is_busy())
        return RobotActivity(open_ones[0].id, self._task_state(open_ones[0].task)[0], free=False)

    def answer(self, request: FleetRequest) -> FleetAnswer | None:
        """Accept or refuse the task in a request; None for any other request, which another service answers."""
        if not isinstance(request, AcceptTask):
            return None
        if not TASK_ID_PATTERN.fullmatch(request.task) or not self._has_mission(request.mission):
            return FleetAnswer(ok=False, reason=f"no mission '{request.mission}' here", data=({"unable": True},))
        if self._queue.has_attempt(request):
            return FleetAnswer()
        if self._is_stopped() or not self.activity().free or self._fleet_robot.read_telemetry().runs:
            return FleetAnswer(ok=False, reason="stopped" if self._is_stopped() else "busy")
        try:
            self._queue.accept(request, self._robot, self._options, self._wall())
        except sqlite3.IntegrityError as error:
            return FleetAnswer(ok=False, reason=str(error), data=({"unable": True},))
        except (sqlite3.Error, TaskError) as error:
            return FleetAnswer(ok=False, reason=str(error))
        return FleetAnswer()

    def step(self, now: float) -> bool:
        """Process the answers of allocators, cancel expired tasks, and send reports that are due.

        Return True while a task is open, so that the next call is due soon.
        """
        while self._answers:
            self._on_report_answer(*self._answers.popleft())
        errands = self._queue.unconfirmed()
        for errand in errands:
            talk = self._report_states.setdefault((errand.id, errand.attempt), _ReportState(begun_at=now))
            self._release_expired(errand, talk, now)
            state = self._task_state(errand.task)
            wait = self._timeouts.heartbeat if talk.answered else self._timeouts.retry_interval
            if state != talk.reported or talk.sent_at + wait <= now:
                talk.reported, talk.sent_at, talk.answered = state, now, False
                self._report(errand, state, now)
        return bool(errands)

    def _report(self, errand: TaskAssignment, said: tuple[TaskState, AttemptEnd], now: float) -> None:
        state, how = said
        report = TaskReport(
            task=errand.id, attempt=errand.attempt, robot=str(self._address), state=state, how=how,
            reason="".join(each for each in errand.task.reason if each.isprintable())[:500],
        )  # fmt: skip
        self._send_request(report, errand.allocator, lambda answer: self._answers.append((errand, said, now, answer)))

    def _on_report_answer(
        self, errand: TaskAssignment, state: tuple[TaskState, AttemptEnd], sent: float, answer: FleetAnswer | None
    ) -> None:
        """Process an allocator's answer to the report that was sent at ``sent``."""
        talk = self._report_states.get((errand.id, errand.attempt))
        if talk is None:
            return
        if answer is None or not (answer.ok or answer.data):
            return  # the request will be repeated
        talk.answered = talk.answered or talk.sent_at == sent
        task = self._queue.task(errand.task.id)
        if task.has_ended and (state[0] in ("FINISHED", "FAILED") or not answer.ok):
            self._queue.mark_confirmed(errand)
            del self._report_states[errand.id, errand.attempt]
        elif not answer.ok:
            self._release_task(task)
        else:
            talk.leased_at = max(sent, talk.leased_at or sent)
            if task.awaits_approval and self._now() < sent + self._timeouts.lease and not self._is_stopped():
                self._queue.approve(task.id, self._wall(), APPROVED_BY)

    def _release_expired(self, errand: TaskAssignment, talk: _ReportState, now: float) -> None:
        """Cancel a repeatable or waiting task whose allocator has not answered for the time of its lease.

        Another robot may get the task then.
        """
        since = talk.begun_at if talk.leased_at is None else talk.leased_at
        waits = errand.task.awaits_approval
        if not errand.task.has_ended and (errand.again or waits) and now > since + self._timeouts.lease:
            self._release_task(errand.task)

    def _release_task(self, task: Task) -> None:
        with suppress(TaskError):  # already ended
            self._queue.cancel(task.id, self._wall())

    def _task_state(self, task: Task) -> tuple[TaskState, AttemptEnd]:
        match task.state:
            case "waiting":
                return ("WAITING" if task.awaits_approval else "INITIALIZING"), ""
            case "running":
                seen = self._fleet_robot.read_telemetry()
                return ("PAUSED" if seen.paused else "RUNNING" if seen.runs else "INITIALIZING"), ""
            case "done":
                return "FINISHED", "success"
            case "failed":
                return "FAILED", "failure"
            case "cancelled" if task.attempts and not task.cancelling:
                return "FAILED", "cancelled"
            case _:
                return "FAILED", "interrupted" if task.attempts else "refused"
