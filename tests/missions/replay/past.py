"""Records in memory: what was told of a run, without a file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import pytest

from missions.executive.events import Event
from missions.executive.moment import Moment
from missions.order import Order
from missions.pictures.draw import drawing_of
from missions.pictures.drawing import Drawing
from missions.runner import Runner
from missions.testing import stage
from missions.testing.stage import IN_PROCESS, Stage
from missions.testing.suite import Case


@dataclass
class Past:
    """What ``missions.replay.rerun`` needs to know of a run."""

    runner: Runner
    events: Sequence[Event]
    moments: list[Moment] = field(default_factory=list)
    whole: bool = True

    def drawing(self) -> Drawing:
        """The tree as it was."""
        return drawing_of(self.runner.plan)


def past_of(order: Order, *, act: Callable[[Runner, Moment], None] | None = None, lag: float | None = None) -> Past:
    """Run an order to its end, and remember it. After each moment, ``act`` may do something to the run.

    ``lag`` is what earlier runs had learnt of the base's.
    """
    events: list[Event] = []
    moments: list[Moment] = []

    def remember(moment: Moment) -> None:
        moments.append(moment)
        if act is not None:
            act(runner, moment)

    runner = Runner(order, listeners=[events.append], limits=IN_PROCESS, on_moment=remember)
    if lag is not None:
        runner.assembled.robot.lag.believe(lag, learnt=True)
    runner.run()
    return Past(runner, events, moments)


def past_of_case(case: Case, patch: pytest.MonkeyPatch) -> Past:
    """Play a case of a test file with true eyes, which are quick, and remember it."""
    moments: list[Moment] = []
    with patch.context() as patched:
        patched.setattr(stage, "Runner", partial(Runner, on_moment=moments.append))
        played = Stage(replace(case, eyes="truth"), IN_PROCESS)
        runner = played.run()
    return Past(runner, played.history.events, moments)
