"""Choices: what a tick could not know, asked one after another and answered by a script that tries every answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

T = TypeVar("T")

Script = tuple[int, ...]
"""The answers of one step, by their places among the options."""


@dataclass(frozen=True, slots=True)
class Choice:
    """One choice as it was made: how many options there were, which was taken, and how to say that."""

    options: int
    taken: int
    value: Any
    say: Callable[[Any], str]

    def __str__(self) -> str:
        return self.say(self.value)


class Oracle:
    """Answers by a script, and with the first option where that has come to its end; ``made`` keeps what was asked."""

    def __init__(self) -> None:
        self.made: list[Choice] = []
        self._reports: dict[str, bool] = {}
        self._script: Script = ()

    def follow(self, script: Script) -> None:
        """Begin a step whose first answers are those of ``script``."""
        self._script = script
        self.made, self._reports = [], {}

    def choose(self, options: Sequence[T], say: Callable[[T], str]) -> T:
        """Return one of ``options``; ``say`` puts it into words for a trace, none where it is not worth any."""
        if len(options) == 1:
            return options[0]
        place = len(self.made)
        taken = self._script[place] if place < len(self._script) else 0
        self.made.append(Choice(len(options), taken, options[taken], say))
        return options[taken]

    def reports(self, sensor: str) -> bool:
        """Say whether a sensor reports in this step: a choice, made once for all who ask."""
        if sensor not in self._reports:
            self._reports[sensor] = self.choose((True, False), partial(_silence, sensor))
        return self._reports[sensor]

    @property
    def all_report(self) -> bool:
        """True while every sensor that was asked in this step reports."""
        return all(self._reports.values())

    @property
    def script(self) -> Script:
        """The answers that were given."""
        return tuple(choice.taken for choice in self.made)

    def next(self) -> Script | None:
        """Return the script to follow next, so that every combination comes up once; None after the last."""
        for place in range(len(self.made) - 1, -1, -1):
            choice = self.made[place]
            if choice.taken + 1 < choice.options:
                return (*self.script[:place], choice.taken + 1)
        return None


def _silence(sensor: str, reports: bool) -> str:
    return "" if reports else f"the {sensor} does not report"
