"""The robot's ears: listen to a microphone on a thread of their own."""

from collections.abc import Callable, Sequence
from threading import Event, Thread
from typing import Protocol

from perception.api import ignore
from perception.hearing.listener import Listener, Worker
from perception.hearing.sound import Piece

PERIOD = 0.05
"""Seconds between looks at the microphone."""


class SoundSource(Protocol):
    """Where sound comes from: a microphone."""

    def read(self, after: int) -> Sequence[Piece]:
        """Return the pieces with a larger number than ``after``, oldest first."""
        ...


class Ears:
    """Gives every sound of ``source`` to ``listener``, whose ``worker`` it starts and ends.

    An error costs the sound that caused it, and goes to ``on_trouble`` unless it is the same as the last.
    """

    def __init__(
        self,
        source: SoundSource,
        listener: Listener,
        worker: Worker,
        *,
        on_trouble: Callable[[Exception], None] = ignore,
    ) -> None:
        self._source = source
        self._listener = listener
        self._worker = worker
        self._on_trouble = on_trouble
        self._trouble = ""
        self._newest = -1
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start listening; returns at once. Safe more than once."""
        if self._thread is None:
            self._ending.clear()
            self._newest = -1  # a microphone may count anew
            self._worker.open(self._listener)
            self._thread = Thread(target=self._run, name="ears", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """End the thread and the recogniser. Safe from any state, more than once, but not from a callback."""
        self._ending.set()
        thread, self._thread = self._thread, None
        self._worker.close()
        if thread is not None:
            thread.join()

    def _run(self) -> None:
        while not self._ending.wait(PERIOD):
            try:
                for piece in self._source.read(self._newest):
                    self._newest = piece.number
                    self._listener.take(piece)
            except Exception as error:  # whatever it is, a robot that goes deaf for good is worse
                self._note(error)

    def _note(self, error: Exception) -> None:
        what = f"{type(error).__name__}: {error}"
        if what != self._trouble:
            self._trouble = what
            self._on_trouble(error)
