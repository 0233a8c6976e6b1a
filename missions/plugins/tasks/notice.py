"""Notices of tasks, and the conversion of values to database rows."""

import json
import sqlite3
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, is_dataclass
from datetime import UTC, datetime
from typing import Any, Literal, TypeVar, cast, get_origin

from config.file_io import parse_json
from missions.codec import Rules, decode, message_fields
from missions.plugins.tasks.task import How, NewTask, RetryPolicy, State, Task, TaskError

# Errors of notices, and secrets from environment variables.


class DeliveryError(RuntimeError):
    """A channel did not deliver a notice; the message has channel and reason."""


def read_secret(name: str, environment: Mapping[str, str]) -> str:
    """Return the value of an environment variable. Raises DeliveryError if it is not set."""
    if name not in environment:
        raise DeliveryError(
            f"the environment variable {name}, named in the robot file, is not set for `mission task serve`"
        )
    return environment[name]


Kind = Literal["done", "failed", "cancelled", "given_up", "missed", "interrupted", "retried", "said"]
"""Kind of a notice about a task.

``interrupted`` and ``retried`` tasks are tried again; ``said`` is a message of the mission itself.
"""


@dataclass(frozen=True, slots=True)
class Notice:
    """A notice about a task. ``id`` is the same at each try, so that a receiver can drop duplicates.

    ``task`` is a number, ``mission`` a name or path, ``time`` an ISO 8601 time in UTC.
    """

    id: str
    task: int
    mission: str
    kind: Kind
    text: str
    time: str

    def as_json(self) -> str:
        """Return the notice as JSON."""
        return json.dumps(asdict(self), ensure_ascii=False)


Channel = Callable[[Notice], None]
"""Delivers a notice; raises an exception if it cannot, and is called again later."""


def ended_notice(task: Task, how: How, state: State, reason: str, now: float) -> Notice:
    """Return the notice that an attempt at a task has ended; ``how`` is the kind of end.

    ``state`` is the state of the task afterwards.
    """
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
        case "cancelled" if not task.cancelling:
            return _make_notice(task, "cancelled", f"{name} was ended{because}; it is not tried again", now)
        case "cancelled":
            return _make_notice(task, "cancelled", f"{name} was cancelled", now)
        case _:
            return _make_notice(task, "failed", f"{name} failed{because}", now)


def missed_notice(task: Task, reason: str, now: float) -> Notice:
    """Return the notice of a task that did not begin in time."""
    return _make_notice(task, "missed", f"{task.name} (task {task.id}) was missed: {reason}", now)


def message_notice(task: Task, number: int, text: str, now: float) -> Notice:
    """Return the notice for the ``number``-th message of the mission in this attempt."""
    return _make_notice(task, "said", text, now, f"-{number}")


def _make_notice(task: Task, kind: Kind, text: str, now: float, more: str = "") -> Notice:
    # A new queue restarts the numbers; the time of addition makes them unique.
    key = f"{task.id}-{task.added:.0f}-{task.attempts}-{kind}{more}"
    return Notice(key, task.id, task.mission, kind, text, datetime.fromtimestamp(now, UTC).isoformat())


# Notices on the terminal of the server.


class TerminalChannel:
    """Prints a line for each notice."""

    def __init__(self, print_line: Callable[[str], None]) -> None:
        self._print = print_line

    def __call__(self, notice: Notice) -> None:
        """Print a notice. Raises OSError if the terminal is closed."""
        self._print(f"{notice.time[:19]}  {notice.text}" + ("" if notice.kind != "said" else f"  (task {notice.task})"))


# Dataclasses as database rows: lists and mappings are JSON, truth values are 0 or 1.

T = TypeVar("T")

RULES = Rules()


def check_texts(new: NewTask) -> None:
    """Raise TaskError if a text of the new task is not valid UTF-8, since the database could not store it."""
    for text in (new.mission, new.robot, *new.options, *new.params, *new.params.values()):
        try:
            text.encode()
        except UnicodeEncodeError as error:
            shown = text.encode(errors="backslashreplace").decode()
            raise TaskError(
                f"'{shown}' cannot be stored: it is not UTF-8", hint="mv gives a file another name"
            ) from error


def row_of(value: Any) -> dict[str, object]:
    """Return the fields of a dataclass object as database columns; the fields of its retry policy are columns too."""
    found = asdict(value)
    found |= found.pop("policy", {})
    return {name: json.dumps(each) if isinstance(each, tuple | list | dict) else each for name, each in found.items()}


def from_row(kind: type[T], row: sqlite3.Row, **more: object) -> T:
    """Return the ``kind`` object in a row, with ``more`` fields. Raises sqlite3.DatabaseError for an invalid row."""
    columns, dataclass_type = {**row, **more}, cast("Any", kind)
    try:
        values = {
            each.name: _column_value(each.kind, columns[each.name])
            for each in message_fields(dataclass_type)
            if each.name in columns
        }
        if kind is Task:
            values["policy"] = {each.name: columns[each.name] for each in message_fields(RetryPolicy)}
        return decode(kind, values, RULES)
    except (LookupError, ValueError, TypeError) as error:
        name = kind.__name__.removeprefix("Queued").lower()
        raise sqlite3.DatabaseError(f"{name} {row['id']} is damaged: {error}") from error


def _column_value(kind: Any, value: Any) -> Any:
    """Return a database column as the JSON value of a field of type ``kind``."""
    if isinstance(value, bytes):
        raise TypeError("bytes instead of a text or a number")
    if kind is bool and value in (0, 1):
        return bool(value)
    return parse_json(value) if is_dataclass(kind) or get_origin(kind) in (tuple, Mapping) else value


def to_new_task(task: Task) -> NewTask:
    """Return the values with which a task was added to the queue, without its state."""
    return NewTask(**{name: getattr(task, name) for name in NewTask.__dataclass_fields__})
