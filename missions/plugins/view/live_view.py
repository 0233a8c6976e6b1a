"""``mission run --view``: the run on the whole terminal, and its usual output lines afterwards."""

import io
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import Self

import click
from rich.text import Text

from drivers.clock import SystemClock
from missions.cli.live import RunDisplay
from missions.cli.session import RunSession
from missions.executive.events import CommandSent, Event, Logged, PerceptSeen, Ticked, VariableSet
from missions.executive.parts import PartsMonitor, PartStatus
from missions.plugins.view.options import ViewOptions
from missions.plugins.view.terminal import view_error
from missions.plugins.view.viewer import Viewer
from missions.runner import Runner
from missions.trees.drawing import to_json
from missions.trees.drawing_builder import drawing_of
from missions.trees.feed import ViewFeed

MAX_KEPT_EVENTS = 20_000
"""Maximum number of events that are kept to be written as lines after the view has ended; older ones are dropped."""

EVENTS_WITHOUT_LINES = (Ticked, CommandSent, PerceptSeen, VariableSet)
"""Types of run events for which no line is written after the view has ended."""


class LiveView:
    """Event listener that shows a run in a view, in place of the ``watcher``, which writes a line for each event.

    The lines are written when the view has ended or died; from then on, the watcher writes each event at once. The
    terminal is restored by the end of the ``with`` at the latest.
    """

    def __init__(self, runner: Runner, watcher: RunDisplay) -> None:
        self._runner = runner
        self._watcher = watcher
        self._line_buffer = io.StringIO()
        self._line_writer = RunDisplay(self._line_buffer)
        self._kept_events: deque[Event] = deque(maxlen=MAX_KEPT_EVENTS)
        self._is_handed_over = False
        assembled = runner.assembled_robot
        looked = None if assembled.eyes is None else assembled.eyes.looked
        self._parts = PartsMonitor(assembled.devices, assembled.robot, looked)
        self._feed = ViewFeed(
            runner.executive,
            SystemClock(),
            look=self._part_states,
            lines=self._event_lines,
            in_tick=runner.twins is not None,
        )
        first: dict[str, object] = {"drawing": to_json(drawing_of(runner.plan)), "robot": assembled.name}
        self._viewer = Viewer(self._feed, first)

    def __enter__(self) -> Self:
        self._line_writer.show_tree(self._runner.root)
        self._viewer.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._viewer.close()
        with suppress(OSError, ValueError):
            self._hand_over()
        self._watcher.__exit__(kind, error, trace)

    def __call__(self, event: Event) -> None:
        """Show an event: in the view, or as a line once the view has ended."""
        self._parts.on_event(event)
        self._feed(event)
        if not isinstance(event, EVENTS_WITHOUT_LINES):
            self._kept_events.append(event)
        if not self._viewer.is_showing:
            self._hand_over()
            if isinstance(event, Ticked):
                self._watcher(event)

    def _hand_over(self) -> None:
        """Let the watcher write the lines held back, and from then on each event at once."""
        if not self._is_handed_over:
            self._is_handed_over = True
            self._watcher.__enter__()
            if cause := self._viewer.exit_cause:
                now = self._runner.executive.time()
                self._kept_events.append(Logged(now, "warning", f"the view ended ({cause}); the mission continues"))
        while self._kept_events:
            self._watcher(self._kept_events.popleft())

    def _part_states(self) -> Sequence[PartStatus]:
        return self._parts.check(self._runner.executive.time())

    def _event_lines(self, event: Event) -> Sequence[str]:
        """Return the lines that the watcher would write for an event."""
        self._line_writer(event)
        lines = Text.from_ansi(self._line_buffer.getvalue()).plain.splitlines()  # FORCE_COLOR may have it coloured
        self._line_buffer.seek(0)
        self._line_buffer.truncate()
        return lines


@contextmanager
def view_run(options: ViewOptions, session: RunSession) -> Iterator[None]:
    """Show a run on the whole terminal. Raises click.UsageError if that is impossible."""
    del options
    if session.out is sys.stderr:
        raise click.UsageError("--view and --json cannot be combined")
    if why := view_error(session.out):
        raise click.UsageError(why)
    if isinstance(session.display, RunDisplay):
        session.replace_display(LiveView(session.runner, session.display))
    yield
