"""Stops a run when the server that started it ends, or when the program that reads its output ends.

A robot must not drive on without an observer: ``mission run ... | head -1`` closes the pipe, which poll reports at
once, not only with the next line. A server, such as the task server, passes each run the read end of a pipe as
``--leash``; the pipe is closed when the server ends. A studio that belongs to a run ends in the same way.
"""

import json
import os
import select
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from threading import Thread
from typing import TextIO

import click

from missions.executive.events import Event, Notified, Ticked
from missions.executive.executive import Executive
from missions.executive.stream import EventStream, Listener

OUTPUT_CLOSED = "its output was closed"


@contextmanager
def watch_outputs(files: Iterable[TextIO], on_closed: Callable[[str], object]) -> Iterator[None]:
    """Call ``on_closed`` with a reason, once, from a thread, when the reader of a pipe among ``files`` closes it."""
    numbers = set()
    for file in files:
        with suppress(OSError, ValueError):  # no file descriptor, or closed
            numbers.add(file.fileno())

    def watch(over: int) -> None:
        poll = select.poll()
        poll.register(over, 0)
        for number in numbers:
            poll.register(number, 0)
        if all(number != over for number, _ in poll.poll()):
            on_closed(OUTPUT_CLOSED)

    with watcher_thread("heeded", watch):
        yield


def watch_outputs_each_tick(files: Iterable[TextIO], on_closed: Callable[[str], object]) -> Listener:
    """Return a listener that checks the pipes among ``files`` at each tick, without a thread: for simulated time."""
    poll = select.poll()
    for file in files:
        with suppress(OSError, ValueError):  # no file descriptor, or closed
            poll.register(file.fileno(), 0)

    def look(event: Event) -> None:
        if isinstance(event, Ticked) and poll.poll(0):
            on_closed(OUTPUT_CLOSED)

    return look


@contextmanager
def watcher_thread(name: str, watch: Callable[[int], None]) -> Iterator[None]:
    """Run ``watch`` in a thread while the context is entered.

    ``watch`` gets the file descriptor of a pipe. The pipe becomes readable at the end of the context; ``watch`` must
    then return.
    """
    over, end = os.pipe()
    thread = Thread(target=watch, args=(over,), name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        os.close(end)
        thread.join()
        os.close(over)


SERVER_GONE = "the server has gone"

STOP_TIMEOUT = 5.0
"""Seconds that a run has to stop after its server has ended.

Then it gets SIGTERM, which ends it even if its main thread hangs.
"""


@contextmanager
def stop_with_server(leash: int | None, executive: Executive, stream: EventStream) -> Iterator[None]:
    """Stop ``executive`` when the server closes the pipe with the descriptor ``leash``; do nothing if it is None.

    Notices of the mission are written to stdout as JSON lines for the server.
    """
    if leash is None:
        yield
        return
    stream.listeners.append(write_notice)
    with _watch_leash(leash, executive.stop):
        yield


def write_notice(event: Event) -> None:
    """Write a JSON line to stdout if ``event`` is a notice of the mission, for the server that started the run."""
    if isinstance(event, Notified):
        click.echo(json.dumps({"notice": event.text}))


def _watch_leash(leash: int, stop: Callable[[str], None]) -> AbstractContextManager[None]:
    def watch(over: int) -> None:
        ready, _, _ = select.select([leash, over], [], [])
        if over in ready:
            return
        stop(SERVER_GONE)
        if not select.select([over], [], [], STOP_TIMEOUT)[0]:
            os.kill(os.getpid(), signal.SIGTERM)

    return watcher_thread("leash", watch)
