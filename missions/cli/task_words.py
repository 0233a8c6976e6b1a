"""How tasks, attempts and notices are told on a terminal."""

from collections.abc import Mapping
from datetime import UTC, datetime

from missions.service.outbox import Letter
from missions.service.task import Attempt, Task
from missions.service.times import local_zone


def row_of(task: Task) -> Mapping[str, str]:
    """Return what the list says of a task, by heading."""
    return {
        "task": str(task.id),
        "state": _state(task),
        "priority": str(task.priority),
        "due": clock(task.since) if task.due else "at once",
        "every": task.every or "-",
        "mission": task.name,
        "params": " ".join(f"{name}={value}" for name, value in task.params.items()) or "-",
        "reason": task.reason,
    }


def _state(task: Task) -> str:
    if task.unapproved:
        return "needs approval"
    return "stopping" if task.cancelling and task.state == "running" else task.state.replace("_", " ")


def about_attempt(attempt: Attempt) -> str:
    """Return what the log says of an attempt."""
    if attempt.ended is None:
        return f"{clock(attempt.began)}  attempt {attempt.number} begins"
    reason = f": {attempt.reason}" if attempt.reason else ""
    seconds = attempt.ended - attempt.began
    return f"{clock(attempt.began)}  attempt {attempt.number}: {attempt.how} after {seconds:.0f} s{reason}"


def about_letter(letter: Letter) -> str:
    """Return what the log says of a notice."""
    if letter.delivered is not None:
        return f"{clock(letter.delivered)}  delivered to {letter.channel}: {letter.notice.text}"
    why = f" ({letter.tries} tries; {letter.last_error})" if letter.tries else ""
    state = "never delivered, and given up," if letter.given_up else "not delivered yet"
    return f"{clock(letter.added)}  {state} to {letter.channel}{why}: {letter.notice.text}"


def clock(time: float) -> str:
    """Write a time, whatever stands in the file: of other calendars than ours, the bare number."""
    try:
        return f"{datetime.fromtimestamp(time, UTC).astimezone(local_zone()):%Y-%m-%d %H:%M:%S}"
    except (ValueError, OverflowError, OSError):
        return f"{time:g}"
