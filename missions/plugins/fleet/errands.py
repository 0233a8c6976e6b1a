"""The tasks that a robot does for its fleet: a journal of their IDs, beside the robot's own queue, which runs them.

What a robot has accepted is on the disk before it says so, and begins only once its keeper has confirmed that the
robot still has it, to a question that the robot has asked itself: an order that was long on its way begins nothing.
"""

import sqlite3
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from missions.plugins.fleet.body import Body
from missions.plugins.fleet.member import Doing
from missions.plugins.fleet.words import TASK, Accept, Address, Answer, Ask, How, Report, TaskState, Times
from missions.plugins.tasks.queue import Queue
from missions.plugins.tasks.task import NewTask, Policy, Task, TaskError

Ready = Callable[[Ask, Address, Callable[[Answer | None], None]], None]
"""Asks a robot something, and hands over its answer, or None, on any thread."""

KEEPER = "its keeper"


@dataclass(frozen=True, slots=True)
class Errand:
    """A task that was accepted, its attempt, and the task in the robot's own queue; ``again`` if it may be repeated."""

    id: str
    attempt: int
    task: Task
    again: bool

    @property
    def keeper(self) -> Address:
        """The robot that keeps it."""
        return Address.read(self.id.rpartition("/")[0])


class ErrandQueue(Queue):
    """The robot's own queue, with the journal of what came of its fleet."""

    def accept(self, ask: Accept, robot: str, options: tuple[str, ...], now: float) -> None:
        """Take a task, with its ID; it waits for ``approve``. Raises sqlite3.IntegrityError for one that was done."""
        policy = Policy("give-up", most=1)  # what comes next, its keeper decides
        new = NewTask(
            mission=ask.mission, params=ask.params, robot=robot, options=options, policy=policy, needs_approval=True
        )
        with self._transaction():
            number = self._insert(new, None, now)
            sql = "INSERT INTO errand (id, attempt, task, again) VALUES (?, ?, ?, ?)"
            self._execute(sql, ask.task, ask.attempt, number, ask.again)

    def untold(self) -> list[Errand]:
        """Return the errands whose end their keeper has not confirmed."""
        rows = self._execute("SELECT * FROM errand WHERE told = 0 ORDER BY task").fetchall()
        return [Errand(row["id"], row["attempt"], self.task(row["task"]), bool(row["again"])) for row in rows]

    def has(self, ask: Accept) -> bool:
        """Say whether this very attempt was accepted before."""
        sql = "SELECT 1 FROM errand WHERE id = ? AND attempt = ?"
        return self._execute(sql, ask.task, ask.attempt).fetchone() is not None

    def told(self, errand: Errand) -> None:
        """Keep that the keeper knows the end."""
        self._execute("UPDATE errand SET told = 1 WHERE id = ? AND attempt = ?", errand.id, errand.attempt)

    def is_busy(self) -> bool:
        """Say whether something runs, or is about to."""
        return bool(self._execute("SELECT 1 FROM task WHERE state = 'running' LIMIT 1").fetchone())


@dataclass(slots=True)
class _Talk:
    """What was said of an errand: the newest report, when it was sent, and until when the errand is this robot's."""

    said: tuple[TaskState, How] | None = None
    sent: float = float("-inf")
    begun: float = 0.0
    answered: bool = False
    leased: float | None = None


class Errands:
    """A Worker of a Member: accepts tasks, reports on them, and lets go of those that are this robot's no more."""

    def __init__(
        self,
        own: Address,
        queue: ErrandQueue,
        body: Body,
        ready: Ready,
        now: Callable[[], float],
        wall: Callable[[], float],
        *,
        held: Callable[[], bool],
        robot: str = "",
        options: tuple[str, ...] = (),
        times: Times | None = None,
        knows: Callable[[str], bool] = lambda _: True,
    ) -> None:
        self._own, self._queue, self._body, self._ask = own, queue, body, ready
        self._now, self._wall, self._held, self._knows = now, wall, held, knows
        self._robot, self._options, self._times = robot, options, times or Times()
        self._talks: dict[tuple[str, int], _Talk] = {}
        self._answers: deque[tuple[Errand, tuple[TaskState, How], float, Answer | None]] = deque()

    def doing(self) -> Doing:
        """Return what the robot is busy with."""
        open_ones = [each for each in self._queue.untold() if not each.task.ended]
        if not open_ones:
            return Doing(free=not self._queue.is_busy())
        return Doing(open_ones[0].id, self._state(open_ones[0].task)[0], free=False)

    def asked(self, ask: Ask) -> Answer | None:
        """See Worker: whether a task is accepted."""
        if not isinstance(ask, Accept):
            return None
        if not TASK.fullmatch(ask.task) or not self._knows(ask.mission):
            return Answer(ok=False, why=f"no mission '{ask.mission}' here", told=({"unable": True},))
        if self._queue.has(ask):
            return Answer()
        if self._held() or not self.doing().free or self._body.look().runs:
            return Answer(ok=False, why="stopped" if self._held() else "busy")
        try:
            self._queue.accept(ask, self._robot, self._options, self._wall())
        except sqlite3.IntegrityError as error:
            return Answer(ok=False, why=str(error), told=({"unable": True},))
        except (sqlite3.Error, TaskError) as error:
            return Answer(ok=False, why=str(error))
        return Answer()

    def step(self, now: float) -> bool:
        """See Worker: report, and heed what the keepers say."""
        while self._answers:
            self._heard(*self._answers.popleft())
        errands = self._queue.untold()
        for errand in errands:
            talk = self._talks.setdefault((errand.id, errand.attempt), _Talk(begun=now))
            self._fence(errand, talk, now)
            said = self._state(errand.task)
            wait = self._times.heartbeat if talk.answered else self._times.again
            if said != talk.said or talk.sent + wait <= now:
                talk.said, talk.sent, talk.answered = said, now, False
                self._report(errand, said, now)
        return bool(errands)

    def _report(self, errand: Errand, said: tuple[TaskState, How], now: float) -> None:
        state, how = said
        report = Report(
            task=errand.id, attempt=errand.attempt, robot=str(self._own), state=state, how=how,
            reason="".join(each for each in errand.task.reason if each.isprintable())[:500],
        )  # fmt: skip
        self._ask(report, errand.keeper, lambda answer: self._answers.append((errand, said, now, answer)))

    def _heard(self, errand: Errand, said: tuple[TaskState, How], sent: float, answer: Answer | None) -> None:
        """Heed what a keeper says to a report that was sent then."""
        talk = self._talks.get((errand.id, errand.attempt))
        if talk is None:
            return
        if answer is None or not (answer.ok or answer.told):
            return  # it is asked again
        talk.answered = talk.answered or talk.sent == sent
        task = self._queue.task(errand.task.id)
        if task.ended and (said[0] in ("FINISHED", "FAILED") or not answer.ok):
            self._queue.told(errand)
            del self._talks[errand.id, errand.attempt]
        elif not answer.ok:
            self._let_go(task)
        else:
            talk.leased = max(sent, talk.leased or sent)
            if task.unapproved and self._now() < sent + self._times.lease and not self._held():
                self._queue.approve(task.id, self._wall(), KEEPER)

    def _fence(self, errand: Errand, talk: _Talk, now: float) -> None:
        """Let go of what others may be given by now, since its keeper was not heard of for so long."""
        since = talk.begun if talk.leased is None else talk.leased
        waits = errand.task.unapproved
        if not errand.task.ended and (errand.again or waits) and now > since + self._times.lease:
            self._let_go(errand.task)

    def _let_go(self, task: Task) -> None:
        with suppress(TaskError):  # it has ended meanwhile
            self._queue.cancel(task.id, self._wall())

    def _state(self, task: Task) -> tuple[TaskState, How]:
        match task.state:
            case "waiting":
                return ("WAITING" if task.unapproved else "INITIALIZING"), ""
            case "running":
                seen = self._body.look()
                return ("PAUSED" if seen.paused else "RUNNING" if seen.runs else "INITIALIZING"), ""
            case "done":
                return "FINISHED", "success"
            case "failed":
                return "FAILED", "failure"
            case _:
                return "FAILED", "interrupted" if task.attempts else "refused"
