"""One run of a sweep, from its seed to its row: the same on every machine."""

from collections.abc import Sequence

import cv2

from missions.language.plan import Plan
from missions.order import RunRequest
from missions.runner import Runner, load, robot_of
from missions.testing.sweep.row import Outcome, Row
from missions.testing.sweep.sweep import Sweep

OVER = "not over within {limit:g} s"
"""Why a run is ended that takes too long."""

OUTCOMES: dict[str, Outcome] = {"success": "success", "failure": "failure", "interrupted": "unfinished"}
"""How a run went, by what its result says."""


class Trials:
    """The runs of one sweep in one process. What they have in common is read once."""

    def __init__(self, sweep: Sweep) -> None:
        self._sweep = sweep
        self._plans: dict[tuple[tuple[str, str], ...], Plan] = {}

    def run(self, seed: int) -> Row:
        """Run the mission once. Raises KeyboardInterrupt when that is interrupted.

        What goes wrong with a run is told in its row, for the others are to go on.
        """
        values = self._sweep.draw(seed)
        try:
            return self._run(seed)
        except Exception as error:  # of whatever kind
            reason = str(error).partition("\n")[0] or type(error).__name__
            return Row(seed, values, "error", reason, 0.0, 0)

    def _run(self, seed: int) -> Row:
        sweep, order = self._sweep, self._sweep.order(seed)
        runner = Runner(order, plan=self._plan(order))
        if runner.twins is None:
            raise RuntimeError("a sweep needs simulated time")
        over = OVER.format(limit=sweep.limit)
        runner.twins.timeline.at(sweep.limit, lambda: runner.executive.stop(over))
        result = runner.run()
        if result.result == "interrupted" and result.reason != over:
            raise KeyboardInterrupt
        outcome = OUTCOMES.get(result.result, "error")
        return Row(seed, sweep.draw(seed), outcome, result.reason, round(result.seconds, 6), result.ticks)

    def _plan(self, order: RunRequest) -> Plan:
        """Return the mission, read once for each set of params: that takes longer than a short run."""
        key = tuple(order.params.items())
        if key not in self._plans:
            self._plans[key] = load(order, robot_of(order))
        return self._plans[key]


def run_some(sweep: Sweep, seeds: Sequence[int]) -> list[Row]:
    """Run some seeds, in their order: the work of a worker. Raises KeyboardInterrupt.

    OpenCV keeps to one thread, for there is a worker for every core.
    """
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        trials = Trials(sweep)
        return [trials.run(seed) for seed in seeds]
    finally:
        cv2.setNumThreads(threads)
