"""A notice of a task: what somebody who is not there wants to know, and what it is known by."""

import json
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, is_dataclass
from datetime import UTC, datetime
from typing import Any, Literal, TypeVar, cast, get_origin

from config.file_io import parse_json
from missions.codec import Rules, decode, message_fields
from missions.plugins.tasks.task import How, NewTask, RetryPolicy, State, Task, TaskError

# Why a notice was not taken, and what a channel reads of secrets.


class DeliveryError(RuntimeError):
    """A channel did not take a notice; the message says which, and why."""


def read_secret(name: str, environment: Mapping[str, str]) -> str:
    """Return what the environment variable ``name`` holds. Raises NotTaken where it is not set."""
    if name not in environment:
        raise DeliveryError(
            f"the environment variable {name}, which the robot file names, is not set for `mission task serve`"
        )
    return environment[name]


Kind = Literal["done", "failed", "cancelled", "given_up", "missed", "interrupted", "retried", "said"]
"""What became of the task: ``interrupted`` and ``retried`` are tried again; ``message_notice`` is a word of the mission's own."""


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


def ended_notice(task: Task, how: How, state: State, reason: str, now: float) -> Notice:
    """Tell that an attempt at ``task`` has ended and in which ``state`` it is now."""
    because, name = f": {reason}" if reason else "", f"{task.name} (task {task.id})"
    match state:
        case "waiting" if how == "interrupted":
            return _make_notice(task, "interrupted", f"{name} was interrupted{because}; it is tried again", now)
        case "waiting":
            return _make_notice(task, "retried", f"{name} failed{because}; it is tried again", now)
        case "given_up":
            return _make_notice(task, "given_up", f"{name} was interrupted, and is given up{because}", now)
        case "done":
            return _make_notice(task, "done", f"{name} is done", now)
        case "cancelled":
            return _make_notice(task, "cancelled", f"{name} was cancelled", now)
        case _:
            return _make_notice(task, "failed", f"{name} failed{because}", now)


def missed_notice(task: Task, reason: str, now: float) -> Notice:
    """Tell that a task was not begun in time."""
    return _make_notice(task, "missed", f"{task.name} (task {task.id}) was missed: {reason}", now)


def message_notice(task: Task, number: int, text: str, now: float) -> Notice:
    """Tell what a mission itself wants to be told, as the ``number``-th thing of this attempt."""
    return _make_notice(task, "said", text, now, f"-{number}")


def _make_notice(task: Task, kind: Kind, text: str, now: float, more: str = "") -> Notice:
    # Numbers begin anew with a new queue; when a task was added tells the two apart.
    key = f"{task.id}-{task.added:.0f}-{task.attempts}-{kind}{more}"
    return Notice(key, task.id, task.mission, kind, text, datetime.fromtimestamp(now, UTC).isoformat())


# Notices on the terminal of the server.


class TerminalChannel:
    """Prints a line for each notice."""

    def __init__(self, print_line: Callable[[str], None]) -> None:
        self._print = print_line

    def __call__(self, notice: Notice) -> None:
        """Print it. Raises OSError where the terminal has gone."""
        self._print(f"{notice.time[:19]}  {notice.text}" + ("" if notice.kind != "said" else f"  (task {notice.task})"))


# Values as the rows of the database that they are kept in: lists and mappings are JSON, truth is 0 or 1.

T = TypeVar("T")

RULES = Rules()


def check_texts(new: NewTask) -> None:
    """Raise TaskError for texts that cannot be kept."""
    for text in (new.mission, new.robot, *new.options, *new.params, *new.params.values()):
        try:
            text.encode()
        except UnicodeEncodeError as error:
            shown = text.encode(errors="backslashreplace").decode()
            raise TaskError(
                f"'{shown}' cannot be kept: it is not UTF-8", hint="mv gives a file another name"
            ) from error


def row_of(value: Any) -> dict[str, object]:
    """Return the columns of a value; those of its policy stand beside the others."""
    found = asdict(value)
    found |= found.pop("policy", {})
    return {name: json.dumps(each) if isinstance(each, tuple | list | dict) else each for name, each in found.items()}


def from_row(kind: type[T], row: sqlite3.Row, **more: object) -> T:
    """Return the value that a row is, with ``more`` members. Raises sqlite3.DatabaseError unless it was written so."""
    columns, wanted = {**row, **more}, cast("Any", kind)
    try:
        values = {
            each.name: _column_value(each.kind, columns[each.name])
            for each in message_fields(wanted)
            if each.name in columns
        }
        if kind is Task:
            values["policy"] = {each.name: columns[each.name] for each in message_fields(RetryPolicy)}
        return decode(kind, values, RULES)
    except (LookupError, ValueError, TypeError) as error:
        name = kind.__name__.lower()
        raise sqlite3.DatabaseError(f"{name} {row['id']} is not as it was written: {error}") from error


def _column_value(kind: Any, value: Any) -> Any:
    """Return a column as JSON has it."""
    if isinstance(value, bytes):
        raise TypeError("bytes, where a text or a number was")
    if kind is bool and value in (0, 1):
        return bool(value)
    return parse_json(value) if is_dataclass(kind) or get_origin(kind) in (tuple, Mapping) else value


def to_new_task(task: Task) -> NewTask:
    """Return what a task was as it was added."""
    return NewTask(**{name: getattr(task, name) for name in NewTask.__dataclass_fields__})
