"""The queue of tasks over the studio: read as it is, and changed by the same words as in a terminal."""

import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import asdict, replace
from re import search

from config.notices import named
from missions.control.commands import BadMessage, Command
from missions.library.folders import state_folder
from missions.plugins.studio.launch import words_of
from missions.plugins.studio.library import check_name
from missions.plugins.studio.wishes import AddTask, ApproveTask, CancelTask, MoveTask, Start, Tasks
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.lock import is_locked, server_lock
from missions.plugins.tasks.queue import Queue
from missions.plugins.tasks.schema import in_words, open_db, queue_file
from missions.plugins.tasks.times import local_zone, wall_clock

Json = dict[str, object]

PATIENCE = 30.0
"""Seconds that `mission task` may take."""


def tasks(command: Command) -> Json:
    """Answer `tasks`."""
    ended = isinstance(command, Tasks) and command.ended
    path, now = queue_file(state_folder()), wall_clock()
    if not path.exists():
        return {"tasks": [], "served": False}
    with in_words(path), closing(open_db(path)) as connection:
        queue = Queue(connection, channels_of, local_zone())
        found = [replace(task, due=queue.expected(task, now)) for task in queue.tasks(ended=ended)]
    told = [asdict(task) | {"channels": [named(each) for each in task.channels]} for task in found]
    return {"tasks": told, "served": is_locked(server_lock(state_folder()))}


def add_task(command: Command) -> Json:
    """Answer `add_task`: by `mission task add`, which checks the mission for its robot as every other time."""
    if not isinstance(command, AddTask):
        raise TypeError(command.word)
    check_wanted(command)
    words = list(words_of(command))
    words += [f"--{name}={value}" for name, value in (("at", command.at), ("every", command.every)) if value]
    words += [f"--priority={command.priority}", f"--retry={command.retry}"]
    words += ["--needs-approval"] * command.needs_approval
    said = _task("add", *words, "--", command.mission)
    found = search(r"task (\d+)", said)
    return {"task": int(found[1]) if found else None, "message": said}


def cancel_task(command: Command) -> Json:
    """Answer `cancel_task`."""
    return {"message": _task("remove", str(command.task if isinstance(command, CancelTask) else 0))}


def approve_task(command: Command) -> Json:
    """Answer `approve_task`."""
    return {
        "message": _task("approve", f"--by={command.by}", str(command.task)) if isinstance(command, ApproveTask) else {}
    }


def move_task(command: Command) -> Json:
    """Answer `move_task`."""
    if not isinstance(command, MoveTask):
        raise TypeError(command.word)
    return {"message": _task("move", f"--priority={command.priority}", "--", str(command.task))}


DOES: Mapping[str, Callable[[Command], Json]] = {
    "tasks": tasks,
    "add_task": add_task,
    "approve_task": approve_task,
    "cancel_task": cancel_task,
    "move_task": move_task,
}
"""What does each command."""


def check_wanted(command: AddTask | Start) -> None:
    """Raise BadMessage for a mission, robot or world that is none of those that there are."""
    check_name("missions", command.mission)
    if command.robot:
        check_name("robots", command.robot)
    if command.world:
        check_name("worlds", command.world)


def _task(*words: str) -> str:
    """Run `mission task`, and return what it says. Raises BadMessage with its own words where it refuses."""
    done = subprocess.run(  # noqa: S603 - ourselves
        [sys.executable, "-m", "missions", "task", *words],
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    if done.returncode:
        raise BadMessage("bad_task", done.stderr.strip()[-4000:] or f"it ended with exit code {done.returncode}")
    return done.stdout.strip()
