"""Things that go wrong on request with a run in simulated time, in the words of test files."""

import shlex
from collections.abc import Mapping
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

from missions.order import RunRequest
from missions.runner import Runner
from missions.studio.form import BadMessage

if TYPE_CHECKING:
    from missions.testing.mishaps import Mishap
    from missions.testing.trouble import Trouble

GLANCE = 0.02
"""Seconds of simulated time within which what was asked for happens."""


def simulated_command(order: RunRequest) -> str:
    """Return the command that runs the same mission on the same robot in simulated time, for faults to happen in."""
    robot = [] if order.robot is None else ["--robot", order.robot]
    params = (word for name, value in order.params.items() for word in ("--param", f"{name}={value}"))
    return shlex.join(["mission", "run", order.mission, *robot, *params, "--simulate", "fast", "--speed", "1"])


class Faults:
    """Lets things go wrong with the twins of a ``runner``, on the thread that its world goes by.

    They are asked for from any thread, in the words of test files.
    """

    def __init__(self, runner: Runner) -> None:
        self._runner = runner
        self._asked: SimpleQueue[Mishap] = SimpleQueue()
        self._trouble: Trouble | None = None
        if runner.twins is not None:
            runner.twins.timeline.every(GLANCE, self._look)

    def told(self) -> Mapping[str, object]:
        """Return what `faults` is answered."""
        from missions.testing.live import examples  # noqa: PLC0415 - as in ``strike``

        found = {"examples": list(examples(self._runner))}
        return found if self._runner.twins else {**found, "command": simulated_command(self._runner.order)}

    def strike(self, words: str) -> None:
        """Let it happen. Raises BadMessage for words that mean nothing, and for what this run cannot have."""
        from missions.testing.live import read_live  # noqa: PLC0415 - a run with which nothing goes wrong needs none of it

        twins, mission = self._runner.twins, self._runner.plan.mission
        if twins is None:
            what = f"'{words}' is unsupported: '{mission}' does not run in simulated time"
            raise BadMessage("unsupported", what, simulated_command(self._runner.order))
        try:
            mishap = read_live(words, self._runner)
        except ValueError as error:
            raise BadMessage("bad_field", str(error)) from error
        if mishap.part not in {*twins.parts, "run"}:
            uses = ", ".join(sorted(twins.parts)) or "no part"
            raise BadMessage("unsupported", f"'{words}' is unsupported: '{mission}' uses {uses}")
        self._asked.put(mishap)

    def _look(self) -> None:
        """Let happen what was asked for."""
        while True:
            try:
                mishap = self._asked.get_nowait()
            except Empty:
                return
            from missions.testing.history import History  # noqa: PLC0415
            from missions.testing.trouble import Trouble  # noqa: PLC0415

            self._trouble = self._trouble or Trouble(self._runner, History())
            self._trouble.arrange([mishap])
