"""Tasks, and the policy that decides what becomes of one once an attempt at it has ended: values, without a queue."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

State = Literal["waiting", "running", "done", "failed", "cancelled", "given_up"]
"""Where a task is: the first two may change, the last four are for good."""

How = Literal["success", "failure", "error", "interrupted", "cancelled"]
"""How an attempt ended; an error is a device that is not there, or a file that is wrong."""

Interrupted = Literal["retry", "give-up"]
"""What to do about a task that was interrupted, of which nobody knows how far it came."""

Verdict = Literal["done", "again", "failed", "given_up"]
"""What follows from the end of an attempt; ``given_up`` was interrupted too often, or must not be done twice."""

PRIORITIES = (-100, 100)
"""The lowest and the highest priority; 0 is that of a task of which nobody says any."""

DEFAULT_MAX_INTERRUPTIONS = 3
"""Times that a task may be interrupted, unless somebody says otherwise; with the last of them it is given up."""


class TaskError(Exception):
    """Something that cannot be asked of the queue: the message says what and why, ``hint`` what to type next."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True, slots=True)
class RetryPolicy:
    """What to do about a task that did not succeed.

    An interrupted one is tried again, until it was interrupted ``most`` times; or never. One that failed is tried again
    ``retries`` times.
    """

    interrupted: Interrupted = "retry"
    most: int = DEFAULT_MAX_INTERRUPTIONS
    retries: int = 0

    def verdict(self, how: str, failures: int, interruptions: int) -> Verdict:
        """Return what follows from an attempt that ended, after so many that failed or were interrupted before.

        It is the one rule for tasks of a robot's queue and for those of a fleet.
        """
        match how:
            case "success":
                return "done"
            case "refused":
                return "again"
            case "interrupted":
                return "again" if self.interrupted == "retry" and interruptions + 1 < self.most else "given_up"
            case _:
                return "again" if failures < self.retries else "failed"


def is_due(not_before: float, now: float, pause: float) -> bool:
    """Return whether the pause before the next attempt is over; a clock that was set back prolongs no pause."""
    return not now < not_before <= now + pause


@dataclass(frozen=True, slots=True, kw_only=True)
class NewTask:
    """What to do: a mission with its params as texts, and when. Times are seconds of the wall clock (Unix).

    ``robot`` is empty for the simulated default; ``options`` are more words for `mission run`. ``due`` is 0 for a task
    that is to begin as soon as its turn comes, whatever the clock says. Of those that are due, the one of the highest
    ``priority`` is first. A task that is not begun within ``late`` seconds of when it is due, or was added, is missed;
    None waits for ever. ``every`` repeats it, as ``times.Repetition`` is written. One that ``needs_approval`` is not begun
    before somebody has approved it, and each of its repetitions anew. ``channels`` are where its notices went
    when it was added, as the outbox writes them: the queue fills them in.
    """

    mission: str
    params: Mapping[str, str] = field(default_factory=dict)
    robot: str = ""
    options: tuple[str, ...] = ()
    due: float = 0.0
    priority: int = 0
    late: float | None = None
    every: str = ""
    policy: RetryPolicy = field(default_factory=RetryPolicy)
    channels: tuple[str, ...] = ()
    needs_approval: bool = False

    @property
    def name(self) -> str:
        """The mission's name for people: that of its file, for one that is named by its whole path."""
        path = Path(self.mission)
        return path.stem if path.is_absolute() else self.mission


@dataclass(frozen=True, slots=True, kw_only=True)
class Task(NewTask):
    """A task in the queue. ``reason`` says why it ended as it did; ``cancelling`` that somebody wants it stopped.

    ``attempts`` were begun; ``failures`` of them ended in a failure, ``interruptions`` were cut off by something that
    counts. It is not begun before ``not_before``. ``approved`` is when somebody did so, ``approved_by`` who.
    ``series`` is the first task of a repetition.
    """

    id: int
    added: float
    state: State
    reason: str
    attempts: int
    failures: int
    interruptions: int
    not_before: float
    cancelling: bool
    series: int | None
    approved: float | None = None
    approved_by: str = ""

    @property
    def awaits_approval(self) -> bool:
        """Whether it waits for somebody to approve it."""
        return self.needs_approval and self.approved is None and self.state == "waiting"

    @property
    def has_ended(self) -> bool:
        """True once nothing more will become of it."""
        return self.state not in ("waiting", "running")

    @property
    def due_since(self) -> float:
        """When it was due, or, where it has no time, was added."""
        return max(self.due, self.added)


@dataclass(frozen=True, slots=True)
class Attempt:
    """One try at a task, the ``number``-th; ``ended`` and ``how`` are None while it goes on."""

    id: int
    task: int
    number: int
    began: float
    ended: float | None
    how: How | None
    reason: str


@dataclass(frozen=True, slots=True)
class Claim:
    """A task that is being run, and the attempt that this is."""

    task: Task
    attempt: int

    @property
    def number(self) -> int:
        """Which attempt at the task this is, from 1."""
        return self.task.attempts


@dataclass(frozen=True, slots=True)
class AttemptOutcome:
    """How an attempt ended, and why; ``stopped`` where it was interrupted because somebody stopped the server."""

    how: How
    reason: str = ""
    stopped: bool = False


def next_state(task: Task, how: How, *, stopped: bool = False) -> State:
    """Return what a running task becomes when the present attempt ends.

    An interruption by somebody who has ``stopped`` the server does not count towards the most that there may be.
    """
    if how == "cancelled" or (how != "success" and task.cancelling):
        return "cancelled" if how in ("cancelled", "interrupted") else "failed"
    verdict = task.policy.verdict(how, task.failures, task.interruptions - stopped)
    return "waiting" if verdict == "again" else verdict
