"""Turn after turn of the same work: on a thread of its own, or by whoever else has the time in hand."""

import logging
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Thread
from typing import ParamSpec, Protocol

# Listeners that cannot hurt a driver: what a report or a callback raises ends no thread that moves a robot.

P = ParamSpec("P")


def guard_callback(listener: Callable[P, object]) -> Callable[P, None]:
    """Return ``listener`` as one that never raises; the first error of it is logged, those that follow are not.

    SystemExit too is kept away from the driver: a terminal whose pipe has broken raises it in whatever thread prints.
    KeyboardInterrupt alone passes, for it is not the listener's: it comes to the main thread wherever that is.
    """
    failed = False

    def guard(*args: P.args, **kwargs: P.kwargs) -> None:
        nonlocal failed
        try:
            listener(*args, **kwargs)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            if not failed:
                failed = True
                with suppress(Exception, SystemExit):  # the log may end at the very terminal that has gone
                    what = f"{type(error).__name__}: {error}"
                    logging.getLogger(__name__).error("a listener failed and is not logged again: %s", what)

    return guard


LoopBody = Callable[[], float]
"""Does what is due, and returns the seconds until more is. It raises nothing: a loop has nobody to tell."""


class Loop(Protocol):
    """Takes turns from ``start`` to ``end``."""

    @property
    def is_alive(self) -> bool:
        """Whether turns are taken."""
        ...

    def start(self) -> None:
        """Take turns from now on, until ``end``; does nothing while they are taken."""
        ...

    def wake(self) -> None:
        """Take the next turn now, whatever the pause was to be. From any thread."""
        ...

    def end(self) -> None:
        """Take no turn any more, and wait for the one that is under way. Safe more than once, but not in a turn."""
        ...


LoopFactory = Callable[[str, LoopBody, Callable[[], object]], Loop]
"""Makes a loop from its name, its turn, and what is done once after the last turn."""


class ThreadLoop:
    """A ``Loop`` on a daemon thread called ``name``, which does ``last`` too; ``end`` cuts a pause short."""

    def __init__(self, name: str, body: LoopBody, on_end: Callable[[], object]) -> None:
        self._name = name
        self._body = body
        self._on_end = on_end
        self._ending = False
        self._woken = Event()
        self._thread: Thread | None = None

    @property
    def is_alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> None:
        """Start the thread; does nothing if it was started and not ended."""
        if self._thread is None:
            self._ending = False
            self._thread = Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def wake(self) -> None:
        """Cut a pause short."""
        self._woken.set()

    def end(self) -> None:
        """End the thread and wait for it."""
        self._ending = True
        self.wake()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        try:
            while not self._ending:
                pause = self._body()
                if pause > 0 and self._woken.wait(pause):
                    self._woken.clear()
        finally:
            self._on_end()
