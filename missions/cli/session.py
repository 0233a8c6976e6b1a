"""A run of ``mission run``, as the plug-ins see it that take part in it."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, TextIO

from missions.executive.events import Event
from missions.executive.stream import Listener
from missions.request import RunRequest
from missions.runner import Runner


class Display(Protocol):
    """A listener that shows a run to a person, between ``__enter__`` and ``__exit__``."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def __call__(self, event: Event) -> None:
        """Show one event."""
        ...


class RunSession:
    """A run that was checked, and whose robot is not open yet.

    ``out`` is where the run is shown, ``files`` the bytes of each file that was read for it, by its whole path.
    """

    def __init__(
        self, request: RunRequest, runner: Runner, display: Display, out: TextIO, files: Mapping[Path, bytes]
    ) -> None:
        self.request, self.runner, self.out, self.files = request, runner, out, files
        self.display = display
        self.outputs: list[Callable[[], Path | None]] = []
        """Each returns, after the run, a file that it has left; None where it could not be written."""
        self.watched_outputs: list[TextIO] = []
        """The run ends once nobody reads one of these any more."""

    def listen(self, listener: Listener) -> None:
        """Have ``listener`` called with each event of the run."""
        self.runner.stream.listeners.append(listener)

    def replace_display(self, display: Display) -> None:
        """Show the run by another display."""
        listeners = self.runner.stream.listeners
        listeners[listeners.index(self.display)] = display
        self.display = display


RunContext = Callable[[RunSession], AbstractContextManager[object]]
"""Takes part in a run: entered before anything moves, left when the robot is closed. Raises click.UsageError."""
