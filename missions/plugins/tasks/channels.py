"""Selection of the notice channels of a task: those of its robot file, or those that were stored with the task."""

from typing import Protocol

from config.diagnostics import InvalidFileError
from config.library import UnknownNameError
from config.notices import TerminalNotice, encode_notice
from missions.library.drivers import load_named_robot

TERMINAL = encode_notice(TerminalNotice())


class NotifiedTask(Protocol):
    """Attributes of a ``missions.plugins.tasks.task.Task`` that select its notice channels."""

    @property
    def robot(self) -> str:
        """Name or file of the task's robot; empty for the simulated default."""
        ...

    @property
    def channels(self) -> tuple[str, ...]:
        """Notice channels, encoded as text, that were stored when the task was added."""
        ...


def channels_of(task: NotifiedTask) -> tuple[str, ...]:
    """Return the encoded channels of a task's robot file; the terminal if it has none.

    If the file cannot be read any more, return the channels stored with the task, so that its failure is still
    reported.
    """
    try:
        notices = load_named_robot(task.robot).notices
    except (InvalidFileError, UnknownNameError):
        return task.channels or (TERMINAL,)
    return tuple(map(encode_notice, notices)) or (TERMINAL,)
