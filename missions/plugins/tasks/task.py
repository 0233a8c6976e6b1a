"""Tasks and their retry policy, as plain values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

State = Literal["waiting", "running", "done", "failed", "cancelled", "given_up"]
"""State of a task; the states from ``done`` on are final."""

How = Literal["success", "failure", "error", "interrupted", "cancelled"]
"""End of an attempt: ``error`` for a missing device or an invalid file, ``cancelled`` if a person has ended it."""

Interrupted = Literal["retry", "give-up"]
"""Policy for an interrupted task, whose progress is unknown."""

Verdict = Literal["done", "again", "failed", "given_up"]
"""Consequence of an attempt's end. ``given_up``: interrupted too often, or interrupted with the policy "give-up"."""

PRIORITIES = (-100, 100)
"""Lowest and highest priority; the default is 0."""

DEFAULT_MAX_INTERRUPTIONS = 3
"""Default number of interruptions after which a task is given up."""


class TaskError(Exception):
    """Invalid request to the task queue; ``hint`` tells the user the next command to try."""

    def __init__(self, message: str, *, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


@dataclass(frozen=True, slots=True)
class RetryPolicy:
    """Retry policy of a task.

    After an interruption it is retried unless ``interrupted`` is "give-up", and given up after ``most`` interruptions.
    After a failure it is retried ``retries`` times.
    """

    interrupted: Interrupted = "retry"
    most: int = DEFAULT_MAX_INTERRUPTIONS
    retries: int = 0

    def verdict(self, how: str, failures: int, interruptions: int) -> Verdict:
        """Return the consequence of an attempt that ended with ``how``, given the previous failures and interruptions.

        Used for tasks of a robot's queue and of a fleet.
        """
        match how:
            case "success":
                return "done"
            case "refused":
                return "again"
            case "cancelled":
                return "given_up"
            case "interrupted":
                return "again" if self.interrupted == "retry" and interruptions + 1 < self.most else "given_up"
            case _:
                return "again" if failures < self.retries else "failed"


def is_due(not_before: float, now: float, pause: float) -> bool:
    """Return whether the pause before the next attempt is over; a clock that was set back does not prolong it."""
    return not now < not_before <= now + pause


@dataclass(frozen=True, slots=True, kw_only=True)
class NewTask:
    """A task to add: a mission with its params as texts, and its time. Times are Unix times in seconds.

    ``robot`` is empty for the simulated default; ``options`` are further arguments of `mission run`. ``due`` is 0 for a
    task that runs as soon as the tasks before it have ended. The task is missed if it has not begun ``late`` seconds
    after it was due or added; None waits for ever. ``every`` is the text of a ``queue.Repetition``. ``channels`` are
    set by the queue: the notice channels of the robot file when the task was added.
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
        """Name of the mission for people: a library name, or the stem of a file."""
        path = Path(self.mission)
        return path.stem if path.is_absolute() else self.mission


@dataclass(frozen=True, slots=True, kw_only=True)
class Task(NewTask):
    """A task in the queue. ``reason`` explains its state; ``cancelling`` means that it is to be stopped.

    ``attempts`` counts all attempts. ``failures`` and ``interruptions`` count only the attempts that use up the retries
    of the task's policy. ``not_before`` is the end of the pause before the next attempt. ``series`` is the number of
    the first task of a repetition.
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
        """Whether the task waits for a person's approval."""
        return self.needs_approval and self.approved is None and self.state == "waiting"

    @property
    def has_ended(self) -> bool:
        """Whether the state of the task is final."""
        return self.state not in ("waiting", "running")

    @property
    def due_since(self) -> float:
        """Time at which the task was due, or was added if it has no due time."""
        return max(self.due, self.added)


@dataclass(frozen=True, slots=True)
class Attempt:
    """An attempt at a task, the ``number``-th; ``ended`` and ``how`` are None while it runs."""

    id: int
    task: int
    number: int
    began: float
    ended: float | None
    how: How | None
    reason: str


@dataclass(frozen=True, slots=True)
class Claim:
    """A running task with the ID of its present attempt."""

    task: Task
    attempt: int

    @property
    def number(self) -> int:
        """Number of the attempt at the task, from 1."""
        return self.task.attempts


@dataclass(frozen=True, slots=True)
class AttemptOutcome:
    """End of an attempt with its reason; ``stopped`` if it was interrupted because the server was stopped."""

    how: How
    reason: str = ""
    stopped: bool = False


def next_state(task: Task, how: How, *, stopped: bool = False) -> State:
    """Return the state of a running task after its attempt.

    An interruption because the server was ``stopped`` does not count towards the policy's maximum of interruptions.
    """
    if how == "cancelled" or (how != "success" and task.cancelling):
        return "cancelled" if how in ("cancelled", "interrupted") else "failed"
    verdict = task.policy.verdict(how, task.failures, task.interruptions - stopped)
    return "waiting" if verdict == "again" else verdict
