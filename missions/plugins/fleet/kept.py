"""The tasks that a robot keeps for its fleet: who has each, and what becomes of it.

One robot keeps a task, from the moment when it was asked for to its end, so that nobody else decides who does it: that
needs no leader. What must not be lost is on the disk before it is answered.
"""

import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from missions.plugins.fleet.words import How, TaskState
from missions.plugins.tasks.notice import from_row, row_of
from missions.plugins.tasks.task import Interrupted, Policy, is_due

PAUSE = 5.0
"""Seconds from an attempt that failed to the next."""

DOUBT = "nobody knows how far it came, and it may not be done twice"


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptTask:
    """A task of a fleet. It is for the robot ``on``, or `any`, that is so as ``where`` says.

    ``robot`` has it, in its ``attempt``, and has begun it perhaps once that is ``confirmed``.
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
    def ended(self) -> bool:
        """Whether nothing more becomes of it."""
        return self.state in ("FINISHED", "FAILED")

    def due(self, now: float) -> bool:
        """Whether it need not wait any longer."""
        return is_due(self.not_before, now, PAUSE)


def after(task: KeptTask, how: How, reason: str, now: float) -> Mapping[str, object]:
    """Return what changes of a task whose attempt has ended so, by its policy."""
    counts: dict[str, object] = {}
    match how:
        case "interrupted":
            counts = {"interruptions": task.interruptions + 1}
        case "failure":
            counts = {"failures": task.failures + 1, "not_before": now + PAUSE}
    policy = Policy(task.if_interrupted, retries=task.retries)
    match policy.verdict(how, task.failures, task.interruptions):
        case "done":
            return {"state": "FINISHED", "reason": reason}
        case "again":
            return {"state": "WAITING", "robot": "", "confirmed": False, "reason": reason, **counts}
        case _:
            doubt = f"{reason}; {DOUBT}" if how == "interrupted" and policy.interrupted == "give-up" else reason
            return {"state": "FAILED", "reason": doubt, **counts}


class Kept:
    """The tasks kept in a database of ``schema.open_db``, for the thread that uses it. Each change is on the disk."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def add(self, task: KeptTask) -> KeptTask:
        """Keep a task; one that is kept already stays as it is. Return what is kept."""
        row = row_of(task)
        names, marks = ", ".join(f'"{name}"' for name in row), ", ".join("?" * len(row))
        self._connection.execute(f"INSERT OR IGNORE INTO kept ({names}) VALUES ({marks})", list(row.values()))  # noqa: S608
        return self.get(task.id) or task

    def get(self, number: str) -> KeptTask | None:
        """Return a task; None for one that is not kept here."""
        row = self._connection.execute("SELECT * FROM kept WHERE id = ?", (number,)).fetchone()
        return None if row is None else from_row(KeptTask, row)

    def tasks(self) -> list[KeptTask]:
        """Return the tasks that are open, the oldest first."""
        sql = "SELECT * FROM kept WHERE state NOT IN ('FINISHED', 'FAILED') ORDER BY rowid"
        return [from_row(KeptTask, row) for row in self._connection.execute(sql)]

    def newest(self, *, ended: bool, before: str = "") -> Iterator[KeptTask]:
        """Yield the tasks that are open, or that have ended, the newest first; those before the one of an ID."""
        sql = f"""SELECT * FROM kept WHERE state {"" if ended else "NOT"} IN ('FINISHED', 'FAILED')
            AND (? = '' OR rowid < (SELECT rowid FROM kept WHERE id = ?)) ORDER BY rowid DESC"""  # noqa: S608
        return (from_row(KeptTask, row) for row in self._connection.execute(sql, (before, before)))

    def change(self, number: str, changes: Mapping[str, object]) -> None:
        """Change a task; one that has ended never changes again, as the database itself says."""
        names = ", ".join(f'"{name}" = ?' for name in changes)
        self._connection.execute(f"UPDATE kept SET {names} WHERE id = ?", [*changes.values(), number])  # noqa: S608
