"""Nondeterministic choices within a step, enumerated by scripts that cover every combination of options."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

T = TypeVar("T")

Script = tuple[int, ...]
"""Choices of one step of the exploration, as indices of the options."""


@dataclass(frozen=True, slots=True)
class NondetChoice:
    """A choice in a step: number of options, index of the option taken, and a function that describes it."""

    options: int
    index: int
    value: Any
    describe: Callable[[Any], str]

    def __str__(self) -> str:
        return self.describe(self.value)


class Oracle:
    """Makes choices from a script, and takes the first option after its end; ``choices`` records them.

    ``reports`` has, for each report of a sensor that a node has read in this step, True if the sensor has sent it.
    ``all_sensors_report`` is true if all are True. ``conditions`` has the results of conditions in this step, by id.
    """

    def __init__(self) -> None:
        self.choices: list[NondetChoice] = []
        self.reports: dict[tuple[str, int | None], bool] = {}
        self.all_sensors_report = True
        self._script: Script = ()
        self.conditions: dict[int, tuple[object, Exception | None]] = {}

    def follow(self, script: Script) -> None:
        """Begin a step of the exploration: make the choices in ``script``, then always take the first option."""
        self._script = script
        self.choices, self.reports, self.all_sensors_report, self.conditions = [], {}, True, {}

    @property
    def follows_script(self) -> bool:
        """Whether a choice of the script is still to be made in this step."""
        return len(self.choices) < len(self._script)

    def choose(self, options: Sequence[T], describe: Callable[[T], str]) -> T:
        """Return one of ``options``, as the script says.

        ``describe`` returns the text of an option for a trace; an empty text means that the choice is not shown.
        """
        if len(options) == 1:
            return options[0]
        place = len(self.choices)
        taken = self._script[place] if place < len(self._script) else 0
        self.choices.append(NondetChoice(len(options), taken, options[taken], describe))
        return options[taken]

    def sensor_reports(self, sensor: str, report: str = "", since: int | None = None) -> bool:
        """Return whether a sensor reports in this step: a choice made once per step for each report of the sensor.

        Nodes that give the same text in ``report`` read the same report; by default it is the newest one of the sensor.
        With ``since``, the index of an instant, the report must be newer than that instant.
        """
        key = report or sensor, since
        found = self.reports.get(key)
        if found is None:
            found = self.reports[key] = self.choose((True, False), partial(_describe_silence, sensor))
            self.all_sensors_report = self.all_sensors_report and found
        return found

    @property
    def script(self) -> Script:
        """Indices of the options chosen in this step so far, in order."""
        return tuple(choice.index for choice in self.choices)

    def next_script(self) -> Script | None:
        """Return the script to follow next, so that every combination occurs once; None after the last."""
        for place in range(len(self.choices) - 1, -1, -1):
            choice = self.choices[place]
            if choice.index + 1 < choice.options:
                return (*self.script[:place], choice.index + 1)
        return None


def _describe_silence(sensor: str, reports: bool) -> str:
    return "" if reports else f"the {sensor} does not report"
