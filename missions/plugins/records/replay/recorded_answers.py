"""What a robot answered at each moment of a record, given out again to whoever asks the same."""

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
    """What a part was told, and what came of it."""

    name: str
    arguments: tuple[object, ...]
    result: object = None

    def matches(self, name: str, arguments: tuple[object, ...]) -> bool:
        """Whether it is the same command."""
        # In words, too: what is not a number is not equal to itself.
        return self.name == name and (self.arguments == arguments or repr(self.arguments) == repr(arguments))

    def __str__(self) -> str:
        return f"{self.name}({', '.join(str(each) for each in self.arguments if each is not None)})"


NO_PARTS: Mapping[str, str] = MappingProxyType({})


class NoRecordedAnswerError(DriverError):
    """A part was asked what the record has no answer to."""


class RecordedAnswers:
    """Answers for the parts of a robot, moment after moment.

    A question that was asked several times in a moment, between commands, is answered in that order; one that was not
    asked in it, as the last time before. ``unheard(question)`` is told of one that has no answer at all,
    ``otherwise(part, then, now)`` of a command that is not as it was then; one of the two is None where there is none.
    ``others`` are the kinds of further parts.
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
        """Begin a moment."""
        self._answers, self._commands = defaultdict(deque), defaultdict(deque)
        for part, what, arguments, value in answers:
            if what in command_names(self._other_kinds.get(part, part)):
                self._commands[part].append(RecordedCommand(what, arguments, value))
            else:
                self._answers[part, what, arguments].append(value)

    def end_tick(self) -> None:
        """End the moment: what was commanded in it then, and not now, is told; what was not asked now is remembered."""
        for part, left in self._commands.items():
            for told in left:
                self._on_different_command(part, told, None)
        for question, values in self._answers.items():
            if values:
                self._store(question, values[-1])

    def answer(self, part: str, query: str, *arguments: object) -> Any:
        """Return what ``part`` answered, or raise the error that it answered with. Raises NotHeardError."""
        question = part, query, arguments
        values = self._answers.get(question)
        if values:
            self._store(question, values.popleft())
        known: Hashable = question if question in self._latest else (part, query)
        if known not in self._latest:
            self._on_unanswered(f"{part}.{query}")
            raise NoRecordedAnswerError(f"{part}: the record has never heard its {query}")
        return _return_or_raise(self._latest[known])

    def command(self, part: str, name: str, accept: Callable[[], object], *arguments: object) -> Any:
        """Return what came of a command then; of one that is not as it was then, what ``accept`` returns."""
        row = self._commands.get(part)
        then = row.popleft() if row else None
        if then is not None and then.matches(name, arguments):
            return _return_or_raise(then.result)
        self._on_different_command(part, then, RecordedCommand(name, arguments))
        return accept()

    def _store(self, question: Question, value: object) -> None:
        self._latest[question] = value
        self._latest[question[:2]] = value


def _return_or_raise(value: object) -> object:
    if isinstance(value, DriverError):
        raise value
    return value
