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
    """Makes choices from a script, and takes the first option after its end; ``choices`` records them."""

    def __init__(self) -> None:
        self.choices: list[NondetChoice] = []
        self._reports: dict[str, bool] = {}
        self._script: Script = ()

    def follow(self, script: Script) -> None:
        """Begin a step whose first choices are those of ``script``."""
        self._script = script
        self.choices, self._reports = [], {}

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

    def sensor_reports(self, sensor: str) -> bool:
        """Return whether a sensor reports in this step: a choice made once per step."""
        if sensor not in self._reports:
            self._reports[sensor] = self.choose((True, False), partial(_describe_silence, sensor))
        return self._reports[sensor]

    @property
    def all_sensors_report(self) -> bool:
        """Whether every sensor read in this step reports."""
        return all(self._reports.values())

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
