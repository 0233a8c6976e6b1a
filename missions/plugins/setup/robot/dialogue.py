"""Terminal dialogue whose answers are saved, so that it can be interrupted and continued."""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click

from config.file_io import read_regular_text, save_file
from missions.cli.keys import KeyReader

POLL_INTERVAL = 0.05
"""Seconds between two calls of the function that ``Dialogue.watch_until_enter`` repeats."""


class Dialogue:
    """Asks questions, and saves each answer under its key in ``file``; saved answers are not asked again.

    With ``yes`` it asks nothing and takes the default of every question; a question without a default raises
    click.UsageError. Actions that move a robot, change a servo or need a person's hand are then skipped.
    """

    def __init__(self, file: Path, *, yes: bool = False) -> None:
        self.yes = yes
        self.question_count = 0
        self._file = file
        self._answers: dict[str, Any] = {}
        self._save_failed = False
        with suppress(
            OSError, ValueError, TypeError, RecursionError
        ):  # start without answers if the file is missing or invalid
            if file.is_file():
                self._answers = dict(json.loads(read_regular_text(file)))

    @property
    def has_answers(self) -> bool:
        """Whether the dialogue has any answers, saved before or given now."""
        return bool(self._answers)

    @property
    def is_saved(self) -> bool:
        """Whether the dialogue has answers, and all of them are saved in its file."""
        return self.has_answers and not self._save_failed

    def print(self, *lines: str) -> None:
        """Print lines to the terminal."""
        for line in lines:
            click.echo(line)

    def has_answer(self, key: str) -> bool:
        """Return whether the question with this key has an answer, saved before or given now."""
        return key in self._answers

    def ask_text(
        self, key: str, question: str, default: str | None = None, check: Callable[[str], object] = lambda _: None
    ) -> str:
        """Return the user's answer to a question; ``check`` raises ValueError with a message for an invalid one."""
        kept = self._answers.get(key)
        while True:
            answer = kept if isinstance(kept, str) else self._prompt(question, default)
            try:
                check(answer)
            except ValueError as error:
                if self.yes:
                    raise click.UsageError(f"{question}: {error}") from None
                self.print(f"  {error}")
                kept = None
                continue
            if kept is not None:
                return self._repeat_answer(question, answer)
            if not self.yes:  # a default that the user has not seen is not saved
                self.save_answer(key, answer)
            return answer

    def ask_choice(
        self,
        key: str,
        question: str,
        choices: Sequence[str],
        default: str | None,
        notes: Mapping[str, str] = MappingProxyType({}),
    ) -> str:
        """Return one of ``choices``, which the user selects by its text or number; ``notes`` describe choices.

        Enter alone selects ``default``; if that is None, an answer is required.
        """

        def check(answer: str) -> None:
            _match_choice(answer, choices)

        if key not in self._answers and not self.yes:
            for number, word in enumerate(choices, 1):
                self.print(f"  {number}  {word}{f': {notes[word]}' if notes.get(word) else ''}")
        return _match_choice(self.ask_text(key, question, default, check), choices)

    def ask_yes_no(self, key: str, question: str, *, default: bool) -> bool:
        """Return the user's answer to a yes/no question; Enter alone gives the ``default``."""
        shown = "Y/n" if default else "y/N"
        words = {"y": True, "yes": True, "n": False, "no": False, "": default}

        def check(answer: str) -> None:
            if answer.lower() not in words:
                raise ValueError("answer y or n")

        return words[self.ask_text(key, f"{question} [{shown}]", "", check).lower()]

    def ask_irreversible(self, question: str) -> bool:
        """Return whether the user agrees to an irreversible action; by default no. The answer is never saved."""
        return not self.yes and self._prompt(f"{question} [y/N]", "").lower() in {"y", "yes"}

    def ask_consent(self, key: str, question: str) -> bool:
        """Return whether the user agrees that something may move or fall.

        The default is no. Only the answer no is saved, so that a yes is not assumed the next time.
        """
        if self.has_answer(key):
            return False
        agreed = self.ask_irreversible(question)
        if not agreed and not self.yes:
            self.save_answer(key, "n")
        return agreed

    def measure_once(self, key: str, measure: Callable[[], Any]) -> Any:
        """Return the measurement saved under ``key``; without one, save and return the result of ``measure``.

        The measurement must be JSON data.
        """
        if key not in self._answers:
            self.save_answer(key, measure())
        return self._answers[key]

    def watch_until_enter(self, look: Callable[[], object], question: str) -> None:
        """Print ``question`` and call ``look`` repeatedly until Enter is pressed; saves nothing."""
        self.question_count += 1
        self.print(question)
        look()
        if sys.stdin.isatty():
            with KeyReader(sys.stdin.fileno()) as keys:
                while keys.read(POLL_INTERVAL) not in {"enter", "end"}:
                    look()
        elif not sys.stdin.readline():
            raise click.Abort
        look()

    def save_answer(self, key: str, answer: Any) -> None:
        """Save an answer under its key atomically; if the file cannot be written, keep it for this dialogue."""
        self._answers[key] = answer
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            save_file(self._file, json.dumps(self._answers, ensure_ascii=False, indent=1))
            self._save_failed = False
        except OSError as error:
            if not self._save_failed:
                self.print(f"answers cannot be saved: {self._file}: {error.strerror or error}")
            self._save_failed = True

    def forget_answers(self, prefix: str = "") -> None:
        """Delete the answers whose keys begin with ``prefix``, or all; delete the file once it has no answer."""
        self._answers = {key: answer for key, answer in self._answers.items() if not key.startswith(prefix)}
        if not self._answers:
            with suppress(OSError):
                self._file.unlink(missing_ok=True)

    def _prompt(self, question: str, default: str | None) -> str:
        if self.yes:
            if default is None:
                raise click.UsageError(f"{question}: no default; leave out --yes")
            return default
        self.question_count += 1
        suffix = f" ({default})" if default else ""
        answer = str(click.prompt(f"{question}{suffix}", default="", show_default=False)).strip()
        return answer or default or ""

    def _repeat_answer(self, question: str, answer: str) -> str:
        if not self.yes:
            self.print(f"{question}: {answer or 'default'}  (saved answer)")
        return answer


def _match_choice(answer: str, choices: Sequence[str]) -> str:
    """Return the word of ``choices`` that an answer means, by text or number. Raises ValueError."""
    if answer in choices:
        return answer
    if answer.isdecimal() and 0 < int(answer) <= len(choices):
        return choices[int(answer) - 1]
    raise ValueError(f"'{answer}' is not one of: {', '.join(choices)}")
