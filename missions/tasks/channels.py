"""Where the notices of a task go: as the file of its robot says when they are made."""

from config.faults import InvalidFileError
from config.library import UnknownNameError, find
from config.notices import TerminalNotice, written
from config.robot import load_robot
from missions.order import DEFAULT_ROBOT
from missions.tasks.task import Task

TERMINAL = written(TerminalNotice())


def channels_of(task: Task) -> tuple[str, ...]:
    """Return the channels of a task's robot, as the outbox writes them; the terminal where it says nothing.

    A robot file that has become unreadable says nothing either: that is no reason to lose what was done.
    """
    try:
        robot = load_robot(find("robots", task.robot or DEFAULT_ROBOT))
    except (InvalidFileError, UnknownNameError):
        return (TERMINAL,)
    return tuple(written(notice) for notice in robot.notices) or (TERMINAL,)
