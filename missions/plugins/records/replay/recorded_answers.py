"""Recorded replies of a robot's parts, returned again to equal queries."""

from collections import defaultdict, deque
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from drivers.errors import DriverError
from missions.executive.proxied_robot import command_names
from missions.executive.tick_record import Answer, Question


@dataclass(frozen=True, slots=True)
class RecordedCommand:
    """A recorded command to a part of the robot, and its result."""

    name: str
    arguments: tuple[object, ...]
    result: object = None

    def matches(self, name: str, arguments: tuple[object, ...]) -> bool:
        """Return whether the recorded command has this name and these arguments."""
        # Compare the text too: NaN is not equal to itself.
        return self.name == name and (self.arguments == arguments or repr(self.arguments) == repr(arguments))

    def __str__(self) -> str:
        return f"{self.name}({', '.join(str(each) for each in self.arguments if each is not None)})"


NO_PARTS: Mapping[str, str] = MappingProxyType({})


class NoRecordedAnswerError(DriverError):
    """The record has no reply to a query."""


class RecordedAnswers:
    """Recorded replies of the parts of a robot, tick by tick.

    If a query is repeated within a tick, its recorded replies are returned in order. A query that the record lacks in
    this tick gets its last known reply. ``on_unanswered(query)`` is called for a query without any reply.
    ``on_different_command(part, recorded, current)`` is called for a command that differs from the record; a missing
    command is None. ``other_kinds`` are the kinds of additional parts, such as a second arm, by name.
    """

    def __init__(
        self,
        *,
        on_unanswered: Callable[[str], None],
        on_different_command: Callable[[str, RecordedCommand | None, RecordedCommand | None], None],
        other_kinds: Mapping[str, str] = NO_PARTS,
    ) -> None:
        self._on_unanswered = on_unanswered
        self._on_different_command = on_different_command
        self._other_kinds = other_kinds
        self._answers: dict[Question, deque[object]] = {}
        self._latest: dict[Hashable, object] = {}
        self._commands: dict[str, deque[RecordedCommand]] = {}

    def begin_tick(self, answers: Iterable[Answer]) -> None:
        """Load the recorded replies of a tick."""
        self._answers, self._commands = defaultdict(deque), defaultdict(deque)
        for part, what, arguments, value in answers:
            if what in command_names(self._other_kinds.get(part, part)):
                self._commands[part].append(RecordedCommand(what, arguments, value))
            else:
                self._answers[part, what, arguments].append(value)

    def end_tick(self) -> None:
        """End the tick: report recorded commands that were not repeated.

        Unused replies are kept as the last known ones.
        """
        for part, left in self._commands.items():
            for command in left:
                self._on_different_command(part, command, None)
        for question, values in self._answers.items():
            if values:
                self._store(question, values[-1])

    def answer(self, part: str, query: str, *arguments: object) -> Any:
        """Return the recorded reply of ``part`` to a query, or raise the error recorded instead.

        Raises NoRecordedAnswerError if the record has no reply.
        """
        question = part, query, arguments
        values = self._answers.get(question)
        if values:
            self._store(question, values.popleft())
        known: Hashable = question if question in self._latest else (part, query)
        if known not in self._latest:
            self._on_unanswered(f"{part}.{query}")
            raise NoRecordedAnswerError(f"{part}: no recorded reply to {query}")
        return _return_or_raise(self._latest[known])

    def command(self, part: str, name: str, accept: Callable[[], object], *arguments: object) -> Any:
        """Return the recorded result of a command to ``part``.

        If the command differs from the record, report it, and return the result of ``accept``, a function that returns
        a default.
        """
        row = self._commands.get(part)
        recorded = row.popleft() if row else None
        if recorded is not None and recorded.matches(name, arguments):
            return _return_or_raise(recorded.result)
        self._on_different_command(part, recorded, RecordedCommand(name, arguments))
        return accept()

    def _store(self, question: Question, value: object) -> None:
        self._latest[question] = value
        self._latest[question[:2]] = value


def _return_or_raise(value: object) -> object:
    if isinstance(value, DriverError):
        raise value
    return value
