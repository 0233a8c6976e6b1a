"""Choices: what a tick could not know, asked one after another and answered by a script that tries every answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

T = TypeVar("T")

Script = tuple[int, ...]
"""The answers of one step, by their places among the options."""


@dataclass(frozen=True, slots=True)
class NondetChoice:
    """One choice as it was made: how many options there were, which was taken, and how to say that."""

    options: int
    index: int
    value: Any
    describe: Callable[[Any], str]

    def __str__(self) -> str:
        return self.describe(self.value)


class Oracle:
    """Answers by a script, and with the first option where that has come to its end; ``choices`` keeps what was asked."""

    def __init__(self) -> None:
        self.choices: list[NondetChoice] = []
        self._reports: dict[str, bool] = {}
        self._script: Script = ()

    def follow(self, script: Script) -> None:
        """Begin a step whose first answers are those of ``script``."""
        self._script = script
        self.choices, self._reports = [], {}

    def choose(self, options: Sequence[T], describe: Callable[[T], str]) -> T:
        """Return one of ``options``; ``describe`` puts it into words for a trace, none where it is not worth any."""
        if len(options) == 1:
            return options[0]
        place = len(self.choices)
        taken = self._script[place] if place < len(self._script) else 0
        self.choices.append(NondetChoice(len(options), taken, options[taken], describe))
        return options[taken]

    def sensor_reports(self, sensor: str) -> bool:
        """Say whether a sensor reports in this step: a choice, made once for all who ask."""
        if sensor not in self._reports:
            self._reports[sensor] = self.choose((True, False), partial(_describe_silence, sensor))
        return self._reports[sensor]

    @property
    def all_sensors_report(self) -> bool:
        """True while every sensor that was asked in this step reports."""
        return all(self._reports.values())

    @property
    def script(self) -> Script:
        """The answers that were given."""
        return tuple(choice.index for choice in self.choices)

    def next_script(self) -> Script | None:
        """Return the script to follow next, so that every combination comes up once; None after the last."""
        for place in range(len(self.choices) - 1, -1, -1):
            choice = self.choices[place]
            if choice.index + 1 < choice.options:
                return (*self.script[:place], choice.index + 1)
        return None


def _describe_silence(sensor: str, reports: bool) -> str:
    return "" if reports else f"the {sensor} does not report"
