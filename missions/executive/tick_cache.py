"""Per-tick input cache: each property of a part is read once per tick, and all values are recorded in order."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, TypeVar, TypeVarTuple

from behaviours.run import log
from drivers.errors import DriverError
from missions.executive.tick_record import Answer

T = TypeVar("T")
A = TypeVarTuple("A")

Query = str | tuple[Any, ...]
"""Key of a cached value of a part: the name of a property, or a name with arguments."""


class TickCache:
    """Cached values of all parts within a tick, while ``is_open``; outside a tick each query goes to its part.

    A command clears the cache of its part, so that a later query sees the new state. Driver errors are cached in
    ``errors`` and raised again. ``answers`` has all results of the tick in order, if ``is_recording``. Only for the
    tick thread.
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
        """Return a cache for ``part``; ``queries`` are functions that read its properties, by name.

        For records, ``sample`` also calls the functions in ``sampled`` each time, and the ``fixed`` queries only once.
        """
        memo = PartCache(part, queries, self)
        self._part_caches.append(memo)
        self._sampled += [(question, partial(memo.sample, question, ask)) for question, ask in (sampled or {}).items()]
        self._fixed += [partial(memo.__getitem__, question) for question in fixed]
        return memo

    def close(self) -> None:
        """End the tick, and clear all caches."""
        self.is_open = False
        list(map(PartCache.clear, self._part_caches))  # faster than a loop, and executed at every tick
        if self.errors:
            self.errors = {}

    def take_answers(self) -> list[Answer]:
        """End the tick; return its recorded answers in order."""
        self.close()
        answers, self.answers = self.answers, []
        return answers

    def clear_errors(self, part: str) -> None:
        """Clear the cached errors of a part."""
        self.errors = {key: error for key, error in self.errors.items() if key[0] != part}

    def sample(self, only: str = "") -> None:
        """Read the properties that this tick has not read, so that a record has them too.

        ``only`` restricts this to the query of that name in each part.
        """
        fixed: list[Callable[[], object]] = []
        if not only:
            fixed, self._fixed = self._fixed, []
        for ask in (*fixed, *(ask for question, ask in self._sampled if only in ("", question))):
            try:
                ask()
            except DriverError:  # the error is cached as the result
                continue
            except Exception:  # reading the state must not end a run
                log.exception("the state of the robot could not be read")


class PartCache(dict[Query, Any]):
    """Cached results of one part by query; ``cache["pose"]`` reads the property from the part if it is not cached.

    It is a dict, since most reads in a tick are repeated, and a dict lookup is faster than a method. Generated proxies
    contain the code of ``command``; the method is for proxies written by hand.
    """

    __slots__ = ("_queries", "part", "tick_cache")

    def __init__(self, part: str, queries: Mapping[str, Callable[[], object]], cache: TickCache) -> None:
        super().__init__()
        self.part = part
        self._queries = queries
        self.tick_cache = cache

    def __missing__(self, question: str) -> Any:
        """Read the property ``question`` from the part. Raises the errors of the part. Called often in every tick."""
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
        """Call ``read``, cache and record its result, unless ``query`` is cached already. Raises its errors."""
        if query not in self:
            questions, self._queries = self._queries, {query: read}
            try:
                self.__missing__(query)
            finally:
                self._queries = questions

    def query(self, name: str, read: Callable[[*A], T], *arguments: *A) -> T:
        """Return the result of a query with arguments, from the cache or from the part."""
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
        """Execute the command ``act`` of the part, record its result and return it. Raises the errors of the part."""
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
        """Record the result of a query or a command, if recording."""
        if self.tick_cache.is_recording and self.tick_cache.is_open:
            self.tick_cache.answers.append((self.part, name, arguments, value))
