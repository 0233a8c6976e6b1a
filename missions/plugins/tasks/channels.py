"""Where the notices of a task go: as the file of its robot says when they are made, or said when it was added."""

from typing import Protocol

from config.diagnostics import InvalidFileError
from config.library import UnknownNameError
from config.notices import TerminalNotice, encode_notice
from missions.library.drivers import load_named_robot

TERMINAL = encode_notice(TerminalNotice())


class NotifiedTask(Protocol):
    """A task, as far as its notices go: a ``missions.plugins.tasks.task.Task``."""

    @property
    def robot(self) -> str:
        """The name or file of its robot; the empty text is the simulated default."""
        ...

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that it was added with."""
        ...


def channels_of(task: NotifiedTask) -> tuple[str, ...]:
    """Return the channels of a task's robot, as the outbox writes them; the terminal where it says nothing.

    Where the file cannot be read any more, they are those that the task was added with: that is just what somebody
    should hear of.
    """
    try:
        notices = load_named_robot(task.robot).notices
    except (InvalidFileError, UnknownNameError):
        return task.channels or (TERMINAL,)
    return tuple(map(encode_notice, notices)) or (TERMINAL,)
