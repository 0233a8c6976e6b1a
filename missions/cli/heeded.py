"""Whether anybody still reads what a command writes: ``mission run ... | head -1`` closes its stdout.

A robot that nobody hears of any more is not to drive on. The kernel tells at once, not with the next line.
"""

import os
import select
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread
from typing import TextIO

GONE = "nobody reads any more what it writes"


@contextmanager
def heeded(files: Iterable[TextIO], gone: Callable[[str], object]) -> Iterator[None]:
    """Call ``gone`` once, from a thread, when the other end of a pipe among ``files`` is closed; files never are."""
    numbers = set()
    for file in files:
        with suppress(OSError, ValueError):  # it is none of the system's, or closed
            numbers.add(file.fileno())

    def watch(over: int) -> None:
        poll = select.poll()
        poll.register(over, 0)
        for number in numbers:
            poll.register(number, 0)
        if all(number != over for number, _ in poll.poll()):
            gone(GONE)

    with watching("heeded", watch):
        yield


@contextmanager
def watching(name: str, watch: Callable[[int], None]) -> Iterator[None]:
    """Have ``watch`` look at something on a thread of its own; the descriptor that it gets is readable in the end."""
    over, end = os.pipe()
    thread = Thread(target=watch, args=(over,), name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        os.close(end)
        thread.join()
        os.close(over)
