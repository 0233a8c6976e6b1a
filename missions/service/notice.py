"""A notice of a task: what somebody who is not there wants to know, and what it is known by."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Literal

from missions.service.task import How, State, Task

Kind = Literal["done", "failed", "cancelled", "given_up", "missed", "interrupted", "retried", "said"]
"""What became of the task: ``interrupted`` and ``retried`` are tried again; ``said`` is a word of the mission's own."""


@dataclass(frozen=True, slots=True)
class Notice:
    """One notice. ``id`` is the same each time that it is sent, so that who gets it twice can tell.

    ``task`` is a number, ``mission`` a name or the path of a file, ``time`` when it was (ISO 8601, UTC).
    """

    id: str
    task: int
    mission: str
    kind: Kind
    text: str
    time: str

    def as_json(self) -> str:
        """Return it as it is sent to programs."""
        return json.dumps(asdict(self), ensure_ascii=False)


Channel = Callable[[Notice], None]
"""Delivers a notice, or raises an exception that says why it could not; then it is tried again."""


def notice_of(text: str) -> Notice:
    """Return the notice that ``as_json`` wrote."""
    return Notice(**json.loads(text))


def ended(task: Task, how: How, state: State, reason: str, now: float) -> Notice:
    """Tell that an attempt at ``task`` has ended and in which ``state`` it is now."""
    because, name = f": {reason}" if reason else "", f"{task.name} (task {task.id})"
    match state:
        case "waiting" if how == "interrupted":
            return _notice(task, "interrupted", f"{name} was interrupted{because}; it is tried again", now)
        case "waiting":
            return _notice(task, "retried", f"{name} failed{because}; it is tried again", now)
        case "given_up":
            return _notice(task, "given_up", f"{name} was interrupted, and is given up{because}", now)
        case "done":
            return _notice(task, "done", f"{name} is done", now)
        case "cancelled":
            return _notice(task, "cancelled", f"{name} was cancelled", now)
        case _:
            return _notice(task, "failed", f"{name} failed{because}", now)


def missed(task: Task, reason: str, now: float) -> Notice:
    """Tell that a task was not begun in time."""
    return _notice(task, "missed", f"{task.name} (task {task.id}) was missed: {reason}", now)


def said(task: Task, number: int, text: str, now: float) -> Notice:
    """Tell what a mission itself wants to be told, as the ``number``-th thing of this attempt."""
    return _notice(task, "said", text, now, f"-{number}")


def _notice(task: Task, kind: Kind, text: str, now: float, more: str = "") -> Notice:
    # Numbers begin anew with a new queue; when a task was added tells the two apart.
    key = f"{task.id}-{task.added:.0f}-{task.attempts}-{kind}{more}"
    return Notice(key, task.id, task.mission, kind, text, datetime.fromtimestamp(now, UTC).isoformat())
