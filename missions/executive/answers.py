"""What the parts of a robot have answered within one moment: each question is asked once, and all is kept in order."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, TypeVar, TypeVarTuple

from behaviours.run import log
from drivers.errors import DriverError
from missions.executive.tick_record import Answer

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

    __slots__ = ("_fixed", "_memos", "_sampled", "kept", "open", "refused", "said")

    def __init__(self) -> None:
        self.kept = False
        self.open = False
        self.said: list[Answer] = []
        self.refused: dict[tuple[str, Asked], DriverError] = {}
        self._memos: list[Memo] = []
        self._sampled: list[tuple[str, Callable[[], object]]] = []
        self._fixed: list[Callable[[], object]] = []

    def memo(
        self,
        part: str,
        questions: Mapping[str, Callable[[], object]],
        *,
        sampled: Mapping[str, Callable[[], object]] | None = None,
        fixed: Iterable[str] = (),
    ) -> "Memo":
        """Return what remembers the answers of a ``part`` to its ``questions``, by their names.

        ``sample`` asks the ``sampled`` ones always, and the ``fixed`` ones the first time only.
        """
        memo = Memo(part, questions, self)
        self._memos.append(memo)
        self._sampled += [(question, partial(memo.sample, question, ask)) for question, ask in (sampled or {}).items()]
        self._fixed += [partial(memo.__getitem__, question) for question in fixed]
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

    def forget(self, part: str) -> None:
        """Forget which questions a part has refused to answer."""
        self.refused = {asked: error for asked, error in self.refused.items() if asked[0] != part}

    def sample(self, only: str = "") -> None:
        """Ask what nobody has asked in this moment, for those who look at the record and for missions changed since.

        With ``only``, that one question, of each part that has it.
        """
        fixed: list[Callable[[], object]] = []
        if not only:
            fixed, self._fixed = self._fixed, []
        for ask in (*fixed, *(ask for question, ask in self._sampled if only in ("", question))):
            try:
                ask()
            except DriverError:  # is an answer
                continue
            except Exception:  # who only looks must not end a run
                log.exception("the state of the robot could not be read")


class Memo(dict[Asked, Any]):
    """What one part has answered, by question: ``memo["pose"]`` asks for it where it is not known yet.

    A dictionary, since most of what a tick asks was asked in it before: then that costs no call of ours. Proxies are
    generated with what ``command`` does in them; it is here for those that are written by hand.
    """

    __slots__ = ("_questions", "answers", "part")

    def __init__(self, part: str, questions: Mapping[str, Callable[[], object]], answers: Answers) -> None:
        super().__init__()
        self.part = part
        self._questions = questions
        self.answers = answers

    def __missing__(self, question: str) -> Any:
        """Ask; raise what the part does. In the hot path of every tick."""
        answers = self.answers
        if answers.refused and (self.part, question) in answers.refused:
            raise answers.refused[self.part, question]
        try:
            answer = self._questions[question]()
        except DriverError as error:
            self._refuse(question, question, (), error)
            raise
        if answers.open:
            self[question] = answer
            if answers.kept:
                answers.said.append((self.part, question, (), answer))
        return answer

    def sample(self, question: str, ask: Callable[[], object]) -> None:
        """Have ``ask`` answer a question, unless the answer is known. Raises what it does."""
        if question not in self:
            questions, self._questions = self._questions, {question: ask}
            try:
                self.__missing__(question)
            finally:
                self._questions = questions

    def ask(self, what: str, ask: Callable[[*A], T], *arguments: *A) -> T:
        """Ask a question with arguments, unless the answer is known."""
        answers, question = self.answers, (what, *arguments)
        if question in self:
            known: T = self[question]
            return known
        if (self.part, question) in answers.refused:
            raise answers.refused[self.part, question]
        try:
            answer = ask(*arguments)
        except DriverError as error:
            self._refuse(question, what, arguments, error)
            raise
        if answers.open:
            self[question] = answer
            self.say(what, arguments, answer)
        return answer

    def command(self, what: str, act: Callable[[*A], T], *arguments: *A) -> T:
        """Have the part do something, and keep what comes of it. Raises what the part does."""
        answers = self.answers
        self.clear()
        if answers.refused:
            answers.forget(self.part)
        try:
            result = act(*arguments)
        except DriverError as error:
            self.say(what, arguments, error)
            raise
        if answers.kept:
            self.say(what, arguments, result)
        return result

    def _refuse(self, question: Asked, what: str, arguments: tuple[object, ...], error: DriverError) -> None:
        if self.answers.open:
            self.answers.refused[self.part, question] = error
            self.say(what, arguments, error)

    def say(self, what: str, arguments: tuple[object, ...], value: object) -> None:
        """Keep what came of a question or a command, as far as that is kept."""
        if self.answers.kept and self.answers.open:
            self.answers.said.append((self.part, what, arguments, value))
