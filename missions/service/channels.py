"""Where the notices of a task go: as the file of its robot says when they are made, or said when it was added."""

from config.faults import InvalidFileError
from config.library import UnknownNameError
from config.notices import TerminalNotice, written
from missions.order import RunRequest
from missions.service.task import Task

TERMINAL = written(TerminalNotice())


def channels_of(task: Task) -> tuple[str, ...]:
    """Return the channels of a task's robot, as the outbox writes them; the terminal where it says nothing.

    Where the file cannot be read any more, they are those that the task was added with: that is just what somebody
    should hear of.
    """
    try:
        return channels_for(task.robot)
    except (InvalidFileError, UnknownNameError):
        return task.channels or (TERMINAL,)


def channels_for(robot: str) -> tuple[str, ...]:
    """Return the channels that the file of a ``robot`` names now; the empty text is the simulated default.

    Raises InvalidFileError or UnknownNameError for one that cannot be read.
    """
    found = RunRequest("", robot=robot or None).robot_file()
    return tuple(written(notice) for notice in found.notices) or (TERMINAL,)
