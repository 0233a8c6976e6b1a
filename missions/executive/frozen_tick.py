"""The frozen tick: while the executive ticks, time stands still and every question has one answer."""

from collections.abc import Callable

from behaviours.run import Run
from missions.executive.answers import Answers
from missions.executive.tick_record import Kind, TickRecord
from missions.executive.variables import Changes

SAMPLE_EVERY = 10
"""Ticks from one look at the parts of the robot that a mission does not ask, to the next."""

OnMoment = Callable[[TickRecord], None]
"""Told of each frozen tick, on the thread that ticks, right after it: it must neither wait nor raise."""


class FrozenTick:
    """Begins and ends the frozen ticks of a ``run``. ``on_moment`` gets the record of each, with its ``answers``."""

    def __init__(self, run: Run, answers: Answers, changes: Changes, on_moment: OnMoment | None = None) -> None:
        self._run = run
        self._answers = answers
        self._changes = changes
        self._on_moment = on_moment
        self._begun_at = 0.0
        answers.kept = on_moment is not None

    def tell_changes(self) -> None:
        """Tell what variables have changed."""
        self._run.stored = False
        self._changes.tell()

    def begin(self) -> None:
        """Let time stand still."""
        if self._on_moment is not None:
            self._begun_at = self._run.wall.now()
        self._answers.open = True
        self._run.held = self._run.clock.now()

    def end(self, kind: Kind, late: float = 0.0) -> None:
        """Let time go on, and hand over what the tick has brought."""
        run, on_moment = self._run, self._on_moment
        time, run.held = run.held or 0.0, None
        if run.stored:
            self.tell_changes()
        if on_moment is None:
            self._answers.close()
            return
        if run.tick % SAMPLE_EVERY == 1:
            self._answers.sample()
        answers, spent = self._answers.take(), run.wall.now() - self._begun_at
        overheld, run.overstayed = run.overstayed, None
        on_moment(TickRecord(kind, run.tick, time, late, spent, answers, overheld))
