"""Tasks as the rows of the database that they are kept in."""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager

from missions.service.task import Attempt, NewTask, Policy, Task, TaskError


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


def task_of(row: sqlite3.Row) -> Task:
    """Return the task that a row is. Raises sqlite3.DatabaseError for one that was not written by us."""
    values = dict(row)
    policy = Policy(values.pop("interrupted"), values.pop("most"), values.pop("retries"))
    with as_written("task", row):
        values["params"] = dict(json.loads(values["params"]))
        for name in ("options", "channels"):
            values[name] = tuple(json.loads(values[name]))
        for name in ("added", "due", "not_before"):
            values[name] = float(values[name])
    for name in ("cancelling", "needs_approval"):
        values[name] = bool(values[name])
    return Task(policy=policy, **values)


def attempt_of(row: sqlite3.Row) -> Attempt:
    """Return the attempt that a row is. Raises sqlite3.DatabaseError for one that was not written by us."""
    values = dict(row)
    with as_written("attempt", row):
        values["began"] = float(values["began"])
        values["ended"] = None if values["ended"] is None else float(values["ended"])
    return Attempt(**values)


@contextmanager
def as_written(what: str, row: sqlite3.Row) -> Iterator[None]:
    """Raise sqlite3.DatabaseError where a row, which is a ``what``, cannot be read as it was written."""
    try:
        if any(isinstance(value, bytes) for value in row):
            raise TypeError("bytes, where a text or a number was")
        yield
    except (LookupError, ValueError, TypeError, RecursionError) as error:
        raise sqlite3.DatabaseError(f"{what} {row['id']} is not as it was written: {error}") from error


def as_new(task: Task) -> NewTask:
    """Return what a task was as it was added."""
    return NewTask(**{name: getattr(task, name) for name in NewTask.__dataclass_fields__})
