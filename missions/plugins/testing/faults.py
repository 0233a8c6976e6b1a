"""Things that go wrong on request with a run in simulated time, in the words of test files."""

import shlex
from collections.abc import Callable, Mapping
from functools import partial

from missions.control.commands import BadMessage
from missions.plugins.testing.history import History
from missions.plugins.testing.live import examples, read_live
from missions.plugins.testing.mishaps import Mishap
from missions.plugins.testing.trouble import Trouble
from missions.request import RunRequest
from missions.runner import Runner


def simulated_command(order: RunRequest) -> str:
    """Return the command that runs the same mission on the same robot in simulated time, for faults to happen in."""
    robot = [] if order.robot is None else ["--robot", order.robot]
    params = (word for name, value in order.params.items() for word in ("--param", f"{name}={value}"))
    return shlex.join(["mission", "run", order.mission, *robot, *params, "--simulate", "fast", "--speed", "1"])


class Faults:
    """Injects faults into the simulated devices of a ``runner``, in the words of test files. Any thread may ask.

    ``in_world`` calls a function on the thread of the simulated world.
    """

    def __init__(self, runner: Runner, in_world: Callable[[Callable[[], None]], None]) -> None:
        self._runner, self._in_world = runner, in_world
        self._trouble: Trouble | None = None

    def told(self) -> Mapping[str, object]:
        """Return the answer to the command `faulty`."""
        found = {"examples": list(examples(self._runner))}
        return found if self._runner.twins else {**found, "command": simulated_command(self._runner.order)}

    def strike(self, words: str) -> None:
        """Inject a fault. Raises BadMessage for words that mean nothing, and for faults that this run cannot have."""
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
        self._in_world(partial(self._arrange, mishap))

    def _arrange(self, mishap: Mishap) -> None:
        self._trouble = self._trouble or Trouble(self._runner, History())
        self._trouble.arrange([mishap])
