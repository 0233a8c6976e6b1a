"""``mission run --view``: the run on the whole terminal, and its lines afterwards, as they would be without it."""

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
from missions.cli.live import Watcher
from missions.cli.session import RunSession
from missions.executive.events import CommandSent, Event, Logged, PerceptSeen, Ticked, VariableSet
from missions.executive.parts import PartState, PartsWatch
from missions.plugins.view.options import ViewOptions
from missions.plugins.view.terminal import unviewable
from missions.plugins.view.viewer import Viewer
from missions.runner import Runner
from missions.trees.draw import drawing_of
from missions.trees.drawing import to_json
from missions.trees.feed import Feed

MOST_KEPT = 20_000
"""Events that are kept to be shown as lines afterwards; older ones are dropped."""

UNWRITTEN = (Ticked, CommandSent, PerceptSeen, VariableSet)
"""Events that are no lines."""


class LiveView:
    """A listener in the place of a ``watcher``, whose lines are kept back for as long as there is a view.

    They are written in the end, or when a view has died before it; then the watcher goes on by itself.
    The terminal is restored by the end of the ``with`` at the latest.
    """

    def __init__(self, runner: Runner, watcher: Watcher) -> None:
        self._runner = runner
        self._watcher = watcher
        self._written = io.StringIO()
        self._writer = Watcher(self._written)
        self._kept: deque[Event] = deque(maxlen=MOST_KEPT)
        self._handed_over = False
        assembled = runner.assembled
        looked = None if assembled.eyes is None else assembled.eyes.looked
        self._parts = PartsWatch(assembled.devices, assembled.robot, looked)
        self._feed = Feed(
            runner.executive, SystemClock(), look=self._look, lines=self._lines, in_tick=runner.twins is not None
        )
        first: dict[str, object] = {"drawing": to_json(drawing_of(runner.plan)), "robot": assembled.name}
        self._viewer = Viewer(self._feed, first)

    def __enter__(self) -> Self:
        self._writer.watch(self._runner.root)
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
        """Show one event: in the view, or as a line once there is none."""
        self._parts.take(event)
        self._feed(event)
        if not isinstance(event, UNWRITTEN):
            self._kept.append(event)
        if not self._viewer.showing:
            self._hand_over()
            if isinstance(event, Ticked):
                self._watcher(event)

    def _hand_over(self) -> None:
        """Let the watcher write what was kept back; from then on, each event at once."""
        if not self._handed_over:
            self._handed_over = True
            self._watcher.__enter__()
            if cause := self._viewer.cause:
                now = self._runner.executive.time()
                self._kept.append(Logged(now, "warning", f"the view has ended ({cause}); the mission goes on without"))
        while self._kept:
            self._watcher(self._kept.popleft())

    def _look(self) -> Sequence[PartState]:
        return self._parts.look(self._runner.executive.time())

    def _lines(self, event: Event) -> Sequence[str]:
        """Return what the watcher would write of an event."""
        self._writer(event)
        lines = Text.from_ansi(self._written.getvalue()).plain.splitlines()  # FORCE_COLOR may have it coloured
        self._written.seek(0)
        self._written.truncate()
        return lines


@contextmanager
def view_run(options: ViewOptions, session: RunSession) -> Iterator[None]:
    """Show a run on the whole terminal. Raises click.UsageError where that cannot be."""
    del options
    if session.out is sys.stderr:
        raise click.UsageError("--view takes the whole terminal, --json leaves it to a program: one of them")
    if why := unviewable(session.out):
        raise click.UsageError(why)
    if isinstance(session.display, Watcher):
        session.show_by(LiveView(session.runner, session.display))
    yield
