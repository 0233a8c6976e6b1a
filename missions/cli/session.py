"""A run of ``mission run`` as plug-ins see it."""

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
    """Listener that shows a run to a person while its context is entered."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def __call__(self, event: Event) -> None:
        """Show one event."""
        ...


class RunSession:
    """A checked run whose robot is not open yet.

    ``out`` is the stream for the display; ``files`` are the contents of all files read for the run, by absolute path.
    """

    def __init__(
        self, request: RunRequest, runner: Runner, display: Display, out: TextIO, files: Mapping[Path, bytes]
    ) -> None:
        self.request, self.runner, self.out, self.files = request, runner, out, files
        self.display = display
        self.outputs: list[Callable[[], Path | None]] = []
        """Functions, called after the run, each of which returns the path of an output file, or None if writing failed.
        """
        self.watched_outputs: list[TextIO] = []
        """Streams for other programs; the run ends when the reader of one closes it."""

    def listen(self, listener: Listener) -> None:
        """Add a listener for the events of the run."""
        self.runner.stream.listeners.append(listener)

    def replace_display(self, display: Display) -> None:
        """Replace the display of the run."""
        listeners = self.runner.stream.listeners
        listeners[listeners.index(self.display)] = display
        self.display = display


RunContext = Callable[[RunSession], AbstractContextManager[object]]
"""Function of a plug-in that returns a context manager for a run. Raises click.UsageError.

The context is entered before anything moves, and left after the robot is closed.
"""
