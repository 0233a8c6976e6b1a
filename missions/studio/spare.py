"""File descriptors that are kept for a stop: a studio that has none left for anything else can still look for runs."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

RESERVED_DESCRIPTORS = 64
"""How many are kept: a folder, a note and a socket for each of some runs at the same time."""


class SpareDescriptors:
    """Holds descriptors, and lends their numbers while something important is done. For one thread."""

    def __init__(self, count: int = RESERVED_DESCRIPTORS) -> None:
        self._count, self._lent = count, 0
        self._held: list[int] = []
        self._fill()

    @contextmanager
    def lent(self) -> Iterator[None]:
        """Have them free while this is entered; from several places at once, until the last one leaves."""
        self._lent += 1
        self.close()
        try:
            yield
        finally:
            self._lent -= 1
            if not self._lent:
                self._fill()

    def close(self) -> None:
        """Hold none any more."""
        while self._held:
            os.close(self._held.pop())

    def _fill(self) -> None:
        try:
            while len(self._held) < self._count:
                self._held.append(os.open(os.devnull, os.O_RDONLY))
        except OSError:
            return  # there are not so many now: those that there are, and more after the next stop
