"""Loops that call a function repeatedly: on a thread of their own, or on simulated time."""

import logging
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Thread
from typing import ParamSpec, Protocol

# Callbacks that cannot harm a driver: their exceptions end no thread that moves a robot.

P = ParamSpec("P")


def guard_callback(listener: Callable[P, object]) -> Callable[P, None]:
    """Return a callback that calls ``listener`` and never raises. Its first exception is logged, further ones are not.

    SystemExit is suppressed as well, since a terminal with a broken pipe raises it in any thread that prints.
    KeyboardInterrupt is raised, because it is not an error of the listener.
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
                with suppress(Exception, SystemExit):  # the log may go to the same broken terminal
                    message = f"{type(error).__name__}: {error}"
                    logging.getLogger(__name__).error(
                        "a callback failed, and its further errors are not logged: %s", message
                    )

    return guard


LoopBody = Callable[[], float]
"""Body of a loop: does the work that is due, and returns the seconds until the next call. It must not raise."""


class Loop(Protocol):
    """Calls a function repeatedly from ``start`` to ``end``."""

    @property
    def is_alive(self) -> bool:
        """Whether the loop runs."""
        ...

    def start(self) -> None:
        """Start the loop; does nothing while it runs."""
        ...

    def wake(self) -> None:
        """Make the next call now, before its time. Callable from any thread."""
        ...

    def end(self) -> None:
        """End the loop, and wait for a call in progress. Safe more than once, but not from the loop itself."""
        ...


LoopFactory = Callable[[str, LoopBody, Callable[[], object]], Loop]
"""Makes a loop from its name, its body, and a function that is called once when the loop ends."""


class ThreadLoop:
    """``Loop`` on a daemon thread called ``name``, which calls ``body`` repeatedly and ``on_end`` at the end."""

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
        """Start the thread; does nothing while it runs."""
        if self._thread is None:
            self._ending = False
            self._thread = Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def wake(self) -> None:
        """Make the next call now, by interrupting the wait of the thread."""
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
