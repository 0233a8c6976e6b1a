"""What a robot answered at each moment of a record, given out again to whoever asks the same."""

from collections import defaultdict, deque
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from drivers.errors import DriverError
from missions.executive.asked import commands_of
from missions.executive.tick_record import Answer, Question


@dataclass(frozen=True, slots=True)
class Told:
    """What a part was told, and what came of it."""

    what: str
    arguments: tuple[object, ...]
    result: object = None

    def same(self, what: str, arguments: tuple[object, ...]) -> bool:
        """Whether it is the same command."""
        # In words, too: what is not a number is not equal to itself.
        return self.what == what and (self.arguments == arguments or repr(self.arguments) == repr(arguments))

    def __str__(self) -> str:
        return f"{self.what}({', '.join(str(each) for each in self.arguments if each is not None)})"


NOTHING: Mapping[str, str] = MappingProxyType({})


class NotHeardError(DriverError):
    """A part was asked what the record has no answer to."""


class Memory:
    """Answers for the parts of a robot, moment after moment.

    A question that was asked several times in a moment, between commands, is answered in that order; one that was not
    asked in it, as the last time before. ``unheard(question)`` is told of one that has no answer at all,
    ``otherwise(part, then, now)`` of a command that is not as it was then; one of the two is None where there is none.
    ``others`` are the kinds of further parts.
    """

    def __init__(
        self,
        *,
        unheard: Callable[[str], None],
        otherwise: Callable[[str, Told | None, Told | None], None],
        others: Mapping[str, str] = NOTHING,
    ) -> None:
        self._unheard = unheard
        self._otherwise = otherwise
        self._others = others
        self._answers: dict[Question, deque[object]] = {}
        self._latest: dict[Hashable, object] = {}
        self._commands: dict[str, deque[Told]] = {}

    def begin(self, answers: Iterable[Answer]) -> None:
        """Begin a moment."""
        self._answers, self._commands = defaultdict(deque), defaultdict(deque)
        for part, what, arguments, value in answers:
            if what in commands_of(self._others.get(part, part)):
                self._commands[part].append(Told(what, arguments, value))
            else:
                self._answers[part, what, arguments].append(value)

    def end(self) -> None:
        """End the moment: what was commanded in it then, and not now, is told; what was not asked now is remembered."""
        for part, left in self._commands.items():
            for told in left:
                self._otherwise(part, told, None)
        for question, values in self._answers.items():
            if values:
                self._keep(question, values[-1])

    def ask(self, part: str, what: str, *arguments: object) -> Any:
        """Return what ``part`` answered, or raise the error that it answered with. Raises NotHeardError."""
        question = part, what, arguments
        values = self._answers.get(question)
        if values:
            self._keep(question, values.popleft())
        known: Hashable = question if question in self._latest else (part, what)
        if known not in self._latest:
            self._unheard(f"{part}.{what}")
            raise NotHeardError(f"{part}: the record has never heard its {what}")
        return _given(self._latest[known])

    def command(self, part: str, what: str, accept: Callable[[], object], *arguments: object) -> Any:
        """Return what came of a command then; of one that is not as it was then, what ``accept`` returns."""
        row = self._commands.get(part)
        then = row.popleft() if row else None
        if then is not None and then.same(what, arguments):
            return _given(then.result)
        self._otherwise(part, then, Told(what, arguments))
        return accept()

    def _keep(self, question: Question, value: object) -> None:
        self._latest[question] = value
        self._latest[question[:2]] = value


def _given(value: object) -> object:
    if isinstance(value, DriverError):
        raise value
    return value
