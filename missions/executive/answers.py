"""What the parts of a robot have answered within one moment: each question is asked once, and all is kept in order."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, TypeVarTuple

from behaviours.run import log
from drivers.errors import DriverError
from missions.executive.moment import Answer

T = TypeVar("T")
A = TypeVarTuple("A")

Asked = str | tuple[Any, ...]
"""A question to a known part: its name, or its name and arguments."""


class Answers:
    """What was answered in the moment that is ``open``; until one is, every question goes to its part.

    A command makes a part forget what it has answered, so that who looks and then asks is told how it looks now. An
    error of a driver is an answer, and raised again: ``refused`` has these. All of this moment is ``said``, in order,
    as far as it is ``kept``. For one thread, the one that ticks.
    """

    __slots__ = ("_memos", "_unchanging", "_watched", "kept", "open", "refused", "said")

    def __init__(self) -> None:
        self.kept = False
        self.open = False
        self.said: list[Answer] = []
        self.refused: dict[tuple[str, Asked], DriverError] = {}
        self._memos: list[Memo] = []
        self._watched: Sequence[Callable[[], object]] = ()
        self._unchanging: Sequence[Callable[[], object]] = ()

    def memo(self, part: str, questions: Mapping[str, Callable[[], object]]) -> "Memo":
        """Return what remembers the answers of a ``part`` to its ``questions``, by their names."""
        memo = Memo(part, questions, self)
        self._memos.append(memo)
        return memo

    def close(self) -> None:
        """End the moment, and forget all that was answered in it."""
        self.open = False
        list(map(Memo.clear, self._memos))  # a loop would cost several times as much, in each tick
        if self.refused:
            self.refused = {}

    def take(self) -> list[Answer]:
        """End the moment; return what was answered in it, in order, as far as that is kept."""
        self.close()
        said, self.said = self.said, []
        return said

    def watch(self, questions: Sequence[Callable[[], object]], unchanging: Sequence[Callable[[], object]] = ()) -> None:
        """Say what ``sample`` is to ask: always, and the first time only."""
        self._watched, self._unchanging = questions, unchanging

    def sample(self) -> None:
        """Ask what nobody has asked in this moment, for those who look at the record and for missions changed since."""
        unchanging, self._unchanging = self._unchanging, ()
        for ask in (*unchanging, *self._watched):
            try:
                ask()
            except DriverError:  # is an answer
                continue
            except Exception:  # who only looks must not end a run
                log.exception("the state of the robot could not be read")


class Memo(dict[Asked, Any]):
    """What one part has answered, by question: ``memo["pose"]`` asks for it where it is not known yet.

    A dictionary, since most of what a tick asks was asked in it before: then that costs no call of ours.
    """

    __slots__ = ("_answers", "_part", "_questions")

    def __init__(self, part: str, questions: Mapping[str, Callable[[], object]], answers: Answers) -> None:
        super().__init__()
        self._part = part
        self._questions = questions
        self._answers = answers

    def __missing__(self, question: str) -> Any:
        """Ask; raise what the part does. In the hot path of every tick."""
        answers = self._answers
        if answers.refused and (self._part, question) in answers.refused:
            raise answers.refused[self._part, question]
        try:
            answer = self._questions[question]()
        except DriverError as error:
            self._refuse(question, question, (), error)
            raise
        if answers.open:
            self[question] = answer
            if answers.kept:
                answers.said.append((self._part, question, (), answer))
        return answer

    def ask(self, what: str, ask: Callable[[*A], T], *arguments: *A) -> T:
        """Ask a question with arguments, unless the answer is known."""
        answers, question = self._answers, (what, *arguments)
        if question in self:
            known: T = self[question]
            return known
        if (self._part, question) in answers.refused:
            raise answers.refused[self._part, question]
        try:
            answer = ask(*arguments)
        except DriverError as error:
            self._refuse(question, what, arguments, error)
            raise
        if answers.open:
            self[question] = answer
            self._say(what, arguments, answer)
        return answer

    def command(self, what: str, act: Callable[[*A], T], *arguments: *A) -> T:
        """Have the part do something, and keep what comes of it. Raises what the part does."""
        answers = self._answers
        self.clear()
        if answers.refused:
            answers.refused = {asked: error for asked, error in answers.refused.items() if asked[0] != self._part}
        try:
            result = act(*arguments)
        except DriverError as error:
            self._say(what, arguments, error)
            raise
        if answers.kept:
            self._say(what, arguments, result)
        return result

    def _refuse(self, question: Asked, what: str, arguments: tuple[object, ...], error: DriverError) -> None:
        if self._answers.open:
            self._answers.refused[self._part, question] = error
            self._say(what, arguments, error)

    def _say(self, what: str, arguments: tuple[object, ...], value: object) -> None:
        if self._answers.kept and self._answers.open:
            self._answers.said.append((self._part, what, arguments, value))
