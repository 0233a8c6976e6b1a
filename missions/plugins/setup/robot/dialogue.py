"""Questions at the terminal whose answers are kept: a dialogue can be left at any moment, and taken up again."""

import json
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from config.reading import read_regular_text, save_file
from missions.cli.keys import Keys

LOOK = 0.05
"""Seconds between two looks while Enter is waited for."""


class Dialogue:
    """Asks, and keeps each answer under its key in the file ``kept``; what is there already is not asked again.

    With ``yes`` it takes the default of every question, and asks nothing: what has none, or would move a robot, change
    a servo or need a hand is left out.
    """

    def __init__(self, kept: Path, *, yes: bool = False) -> None:
        self.yes = yes
        self.asked = 0
        self._kept = kept
        self._answers: dict[str, Any] = {}
        self._unkept = False
        with suppress(OSError, ValueError, TypeError, RecursionError):  # none, or not to be read: as if there were none
            if kept.is_file():
                self._answers = dict(json.loads(read_regular_text(kept)))

    @property
    def begun(self) -> bool:
        """Whether there are answers, from before or of now."""
        return bool(self._answers)

    @property
    def kept(self) -> bool:
        """Whether there are answers, and the next dialogue will have them all."""
        return self.begun and not self._unkept

    def tell(self, *lines: str) -> None:
        """Say something."""
        for line in lines:
            click.echo(line)

    def knows(self, key: str) -> bool:
        """Whether there is an answer under a key."""
        return key in self._answers

    def text(
        self, key: str, question: str, default: str | None = None, check: Callable[[str], object] = lambda _: None
    ) -> str:
        """Ask for a text; ``check`` raises ValueError, in words, for what cannot be."""
        kept = self._answers.get(key)
        while True:
            answer = kept if isinstance(kept, str) else self._asked(question, default)
            try:
                check(answer)
            except ValueError as error:
                if self.yes:
                    raise click.UsageError(f"{question}: {error}") from None
                self.tell(f"  {error}")
                kept = None
                continue
            if kept is not None:
                return self._again(question, answer)
            if not self.yes:  # a default that nobody has seen is no answer for a later dialogue
                self.keep(key, answer)
            return answer

    def choice(self, key: str, question: str, among: Sequence[str], default: str | None) -> str:
        """Ask for one of several words; its number will do, too. Without a default one has to be named."""

        def check(answer: str) -> None:
            _chosen(answer, among)

        if key not in self._answers and not self.yes:
            self.tell(*(f"  {number}  {word}" for number, word in enumerate(among, 1)))
        return _chosen(self.text(key, question, default, check), among)

    def confirm(self, key: str, question: str, *, default: bool) -> bool:
        """Ask yes or no."""
        shown = "Y/n" if default else "y/N"
        words = {"y": True, "yes": True, "n": False, "no": False, "": default}

        def check(answer: str) -> None:
            if answer.lower() not in words:
                raise ValueError("answer y or n")

        return words[self.text(key, f"{question} [{shown}]", "", check).lower()]

    def sure(self, question: str) -> bool:
        """Ask yes or no for what cannot be undone: no by default, and never kept."""
        return not self.yes and self._asked(f"{question} [y/N]", "").lower() in {"y", "yes"}

    def consent(self, key: str, question: str) -> bool:
        """Ask whether something may move or fall: no by default. Who comes back is asked again, after a yes."""
        if self.knows(key):
            return False
        agreed = self.sure(question)
        if not agreed and not self.yes:
            self.keep(key, "n")
        return agreed

    def measured(self, key: str, measure: Callable[[], Any]) -> Any:
        """Return what was measured, as JSON has it: now, or before the dialogue was left."""
        if key not in self._answers:
            self.keep(key, measure())
        return self._answers[key]

    def watch(self, look: Callable[[], object], question: str) -> None:
        """Look again and again until Enter is pressed; nothing of it is kept."""
        self.asked += 1
        self.tell(question)
        look()
        if sys.stdin.isatty():
            with Keys(sys.stdin.fileno()) as keys:
                while keys.read(LOOK) not in {"enter", "end"}:
                    look()
        elif not sys.stdin.readline():
            raise click.Abort
        look()

    def keep(self, key: str, answer: Any) -> None:
        """Keep an answer, whole or not at all; where that cannot be, for this dialogue only."""
        self._answers[key] = answer
        try:
            self._kept.parent.mkdir(parents=True, exist_ok=True)
            save_file(self._kept, json.dumps(self._answers, ensure_ascii=False, indent=1))
            self._unkept = False
        except OSError as error:
            if not self._unkept:
                self.tell(f"answers cannot be kept: {self._kept}: {error.strerror or error}")
            self._unkept = True

    def forget(self, beginning: str = "") -> None:
        """Forget the answers whose keys begin so; all of them, and the file, for nothing."""
        self._answers = {key: answer for key, answer in self._answers.items() if not key.startswith(beginning)}
        if not self._answers:
            with suppress(OSError):
                self._kept.unlink(missing_ok=True)

    def _asked(self, question: str, default: str | None) -> str:
        if self.yes:
            if default is None:
                raise click.UsageError(f"{question}: there is no default for it; leave out --yes")
            return default
        self.asked += 1
        suffix = f" ({default})" if default else ""
        answer = str(click.prompt(f"{question}{suffix}", default="", show_default=False)).strip()
        return answer or default or ""

    def _again(self, question: str, answer: str) -> str:
        if not self.yes:
            self.tell(f"{question}: {answer or 'as proposed'}  (answered before)")
        return answer


def _chosen(answer: str, among: Sequence[str]) -> str:
    """Return the word that is meant. Raises ValueError."""
    if answer in among:
        return answer
    if answer.isdecimal() and 0 < int(answer) <= len(among):
        return among[int(answer) - 1]
    raise ValueError(f"'{answer}' is none of: {', '.join(among)}")
