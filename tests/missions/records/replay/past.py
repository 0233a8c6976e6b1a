"""Records in memory: what was told of a run, without a file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest

from missions.executive.events import Event
from missions.executive.stream import Listener
from missions.executive.tick_record import TickRecord
from missions.plugins.testing import case_runner
from missions.plugins.testing.case_runner import IN_PROCESS_LIMITS
from missions.plugins.testing.case_verdict import CaseVerdict, play
from missions.plugins.testing.suite import Case
from missions.request import RunRequest
from missions.runner import Runner
from missions.trees.drawing import TreeDrawing
from missions.trees.drawing_builder import drawing_of


@dataclass
class Past:
    """What ``missions.plugins.records.replay.rerun`` needs to know of a run."""

    runner: Runner
    events: Sequence[Event]
    tick_records: list[TickRecord] = field(default_factory=list)
    is_complete: bool = True

    def drawing(self) -> TreeDrawing:
        """The tree as it was."""
        return drawing_of(self.runner.plan)


def past_of(
    order: RunRequest, *, act: Callable[[Runner, TickRecord], None] | None = None, lag: float | None = None
) -> Past:
    """Run an order to its end, and remember it. After each moment, ``act`` may do something to the run.

    ``lag`` is what earlier runs had learnt of the base's.
    """
    events: list[Event] = []
    moments: list[TickRecord] = []

    def remember(moment: TickRecord) -> None:
        moments.append(moment)
        if act is not None:
            act(runner, moment)

    runner = Runner(order, listeners=[events.append], limits=IN_PROCESS_LIMITS)
    runner.observe(remember)
    if lag is not None:
        runner.assembled_robot.robot.lag.set_prior(lag, learnt=True)
    runner.run()
    return Past(runner, events, moments)


def past_of_case(case: Case, patch: pytest.MonkeyPatch) -> tuple[CaseVerdict, Past]:
    """Play a case of a test file; return what became of it, and what was told of its run."""
    past: list[Past] = []

    def remembering(order: RunRequest, *, listeners: Sequence[Listener], **options: Any) -> Runner:
        events: list[Event] = []
        moments: list[TickRecord] = []
        runner = Runner(order, listeners=[*listeners, events.append], **options)
        runner.observe(moments.append)
        past.append(Past(runner, events, moments))
        return runner

    with patch.context() as patched:
        patched.setattr(case_runner, "Runner", remembering)
        verdict = play(case, limits=IN_PROCESS_LIMITS)
    return verdict, past[0]
