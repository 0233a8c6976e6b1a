"""Whose turn it is to be heard: the rule that every voice keeps."""

from bisect import insort
from collections.abc import Iterator
from typing import Generic, Protocol, TypeVar

from drivers.api import Priority


class Urgent(Protocol):
    """What has a priority."""

    @property
    def priority(self) -> Priority:
        """What it goes before."""
        ...


W = TypeVar("W", bound=Urgent)


class Turns(Generic[W]):
    """What is heard and what waits: of the highest priority first, then the oldest. Who uses it has the lock."""

    def __init__(self) -> None:
        self._queue: list[W] = []

    def __iter__(self) -> Iterator[W]:
        """Yield what there is now, in order."""
        return iter(tuple(self._queue))

    @property
    def first(self) -> W | None:
        """Whose turn it is."""
        return self._queue[0] if self._queue else None

    def insert(self, words: W) -> None:
        """Put ``words`` where they belong, which may be first."""
        insort(self._queue, words, key=lambda each: -each.priority)

    def drop(self, words: W) -> None:
        """Take ``words`` out, if they are there."""
        if words in self._queue:
            self._queue.remove(words)
