"""What the parts of a robot have answered within one moment: each question is asked once, and all is kept in order."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, TypeVar, TypeVarTuple

from behaviours.run import log
from drivers.errors import DriverError
from missions.executive.tick_record import Answer

T = TypeVar("T")
A = TypeVarTuple("A")

Query = str | tuple[Any, ...]
"""A question to a known part: its name, or its name and arguments."""


class TickCache:
    """What was answered in the moment that is ``is_open``; until one is, every question goes to its part.

    A command makes a part forget what it has answered, so that who looks and then asks is told how it looks now. An
    error of a driver is an answer, and raised again: ``errors`` has these. All of this moment is ``answers``, in order,
    as far as it is ``is_recording``. For one thread, the one that ticks.
    """

    __slots__ = ("_fixed", "_part_caches", "_sampled", "answers", "errors", "is_open", "is_recording")

    def __init__(self) -> None:
        self.is_recording = False
        self.is_open = False
        self.answers: list[Answer] = []
        self.errors: dict[tuple[str, Query], DriverError] = {}
        self._part_caches: list[PartCache] = []
        self._sampled: list[tuple[str, Callable[[], object]]] = []
        self._fixed: list[Callable[[], object]] = []

    def add_part(
        self,
        part: str,
        queries: Mapping[str, Callable[[], object]],
        *,
        sampled: Mapping[str, Callable[[], object]] | None = None,
        fixed: Iterable[str] = (),
    ) -> "PartCache":
        """Return what remembers the answers of a ``part`` to its ``questions``, by their names.

        ``sample`` asks the ``sampled`` ones always, and the ``fixed`` ones the first time only.
        """
        memo = PartCache(part, queries, self)
        self._part_caches.append(memo)
        self._sampled += [(question, partial(memo.sample, question, ask)) for question, ask in (sampled or {}).items()]
        self._fixed += [partial(memo.__getitem__, question) for question in fixed]
        return memo

    def close(self) -> None:
        """End the moment, and forget all that was answered in it."""
        self.is_open = False
        list(map(PartCache.clear, self._part_caches))  # a loop would cost several times as much, in each tick
        if self.errors:
            self.errors = {}

    def take_answers(self) -> list[Answer]:
        """End the moment; return what was answered in it, in order, as far as that is kept."""
        self.close()
        said, self.answers = self.answers, []
        return said

    def clear_errors(self, part: str) -> None:
        """Forget which questions a part has refused to answer."""
        self.errors = {asked: error for asked, error in self.errors.items() if asked[0] != part}

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


class PartCache(dict[Query, Any]):
    """What one part has answered, by question: ``memo["pose"]`` asks for it where it is not known yet.

    A dictionary, since most of what a tick asks was asked in it before: then that costs no call of ours. Proxies are
    generated with what ``command`` does in them; it is here for those that are written by hand.
    """

    __slots__ = ("_queries", "part", "tick_cache")

    def __init__(self, part: str, queries: Mapping[str, Callable[[], object]], cache: TickCache) -> None:
        super().__init__()
        self.part = part
        self._queries = queries
        self.tick_cache = cache

    def __missing__(self, question: str) -> Any:
        """Ask; raise what the part does. In the hot path of every tick."""
        answers = self.tick_cache
        if answers.errors and (self.part, question) in answers.errors:
            raise answers.errors[self.part, question]
        try:
            answer = self._queries[question]()
        except DriverError as error:
            self._record_error(question, question, (), error)
            raise
        if answers.is_open:
            self[question] = answer
            if answers.is_recording:
                answers.answers.append((self.part, question, (), answer))
        return answer

    def sample(self, query: str, read: Callable[[], object]) -> None:
        """Have ``query`` answer a question, unless the answer is known. Raises what it does."""
        if query not in self:
            questions, self._queries = self._queries, {query: read}
            try:
                self.__missing__(query)
            finally:
                self._queries = questions

    def query(self, name: str, read: Callable[[*A], T], *arguments: *A) -> T:
        """Ask a question with arguments, unless the answer is known."""
        answers, question = self.tick_cache, (name, *arguments)
        if question in self:
            known: T = self[question]
            return known
        if (self.part, question) in answers.errors:
            raise answers.errors[self.part, question]
        try:
            answer = read(*arguments)
        except DriverError as error:
            self._record_error(question, name, arguments, error)
            raise
        if answers.is_open:
            self[question] = answer
            self.record(name, arguments, answer)
        return answer

    def command(self, name: str, act: Callable[[*A], T], *arguments: *A) -> T:
        """Have the part do something, and keep what comes of it. Raises what the part does."""
        answers = self.tick_cache
        self.clear()
        if answers.errors:
            answers.clear_errors(self.part)
        try:
            result = act(*arguments)
        except DriverError as error:
            self.record(name, arguments, error)
            raise
        if answers.is_recording:
            self.record(name, arguments, result)
        return result

    def _record_error(self, query: Query, name: str, arguments: tuple[object, ...], error: DriverError) -> None:
        if self.tick_cache.is_open:
            self.tick_cache.errors[self.part, query] = error
            self.record(name, arguments, error)

    def record(self, name: str, arguments: tuple[object, ...], value: object) -> None:
        """Keep what came of a question or a command, as far as that is kept."""
        if self.tick_cache.is_recording and self.tick_cache.is_open:
            self.tick_cache.answers.append((self.part, name, arguments, value))
