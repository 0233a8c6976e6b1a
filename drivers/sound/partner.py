"""One end of the talk with a program of ours: who wants something of it waits for the answer, or to be broken off."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import Enum
from threading import Condition
from typing import Final

from drivers.api import DeviceStatus, Report, ignore
from drivers.clock import Clock
from drivers.errors import NoReply, NotConnected
from drivers.sound.cut import Cut
from drivers.transport.loop import guarded
from drivers.transport.pipe import Message, Worker

START = 5.0
"""Seconds for which a program that starts is waited for, also when it has died: shared machines are slow."""

STUCK = 10.0
"""Seconds after its start when a program that somebody waits for, and that is not ready yet, is taken to hang."""

HOPELESS = 3
"""Deaths in a row after which a program is not waited for any more; it is started again all the same."""


class ProgramState(Enum):
    """State of a program; DEAD: its worker starts it again."""

    CLOSED, STARTING, READY, DEAD = range(4)


class ProgramEvent(Enum):
    """Event of a program and of its worker."""

    OPEN, START, READY, DIE, CLOSE = range(5)


TRANSITIONS: Final = {
    **{(state, ProgramEvent.CLOSE): ProgramState.CLOSED for state in ProgramState},
    (ProgramState.CLOSED, ProgramEvent.OPEN): ProgramState.STARTING,
    (ProgramState.STARTING, ProgramEvent.START): ProgramState.STARTING,
    (ProgramState.STARTING, ProgramEvent.READY): ProgramState.READY,
    (ProgramState.STARTING, ProgramEvent.DIE): ProgramState.DEAD,
    (ProgramState.READY, ProgramEvent.DIE): ProgramState.DEAD,
    (ProgramState.DEAD, ProgramEvent.START): ProgramState.STARTING,
}
"""Any other pair changes nothing: what a program says while it is being closed comes too late."""


class Partner(ABC):
    """Talks with ``worker``: a ``drivers.transport.pipe.Talker``. A subclass says what its answers mean."""

    def __init__(self, worker: Worker, clock: Clock, *, report: Report = ignore, hint: str = "") -> None:
        self._worker = worker
        self._clock = clock
        self._report = guarded(report)
        self._hint = hint
        self._news = Condition()  # over all that is told
        self._program = ProgramState.CLOSED
        self._since = 0.0  # when it was started last
        self._deaths = 0  # in a row
        self._absent = ""
        self._told: set[DeviceStatus] = set()

    def open(self) -> None:
        """Start the program; returns at once. Safe more than once."""
        if self._program is ProgramState.CLOSED:
            self._handle_program(ProgramEvent.OPEN)
            self._worker.open(self)

    def close(self) -> None:
        """End it. Safe from any state, more than once."""
        self._handle_program(ProgramEvent.CLOSE)
        self._worker.close()
        with self._news:
            self._deaths, self._absent = 0, ""
            self._news.notify_all()

    @property
    def _ready(self) -> bool:
        return self._program is ProgramState.READY

    def _handle_program(self, event: ProgramEvent) -> None:
        with self._news:
            self._program = TRANSITIONS.get((self._program, event), self._program)
            self._news.notify_all()

    @property
    def broken(self) -> str:
        """Why there is no hope for it, else ""."""
        health = self._worker.health()
        return self._absent or (health.detail if self._deaths >= HOPELESS and not health.online else "")

    def _be_ready(self, cut: Cut) -> bool:
        """Wait for the program to be ready; False when it was broken off. Raises NotConnected and NoReply."""
        with cut.then(self._wake), self._news:
            settled = ProgramState.READY, ProgramState.CLOSED
            self._news.wait_for(lambda: self._program in settled or cut.made or self.broken, START)
            if self._ready or cut.made:
                return not cut.made
            stuck = self._worker.health().online and self._clock.now() - self._since > STUCK
        if stuck and not self.broken:
            self._worker.kill()
            raise NoReply(f"{self._worker.name}: its program hangs while it starts", hint=self._hint)
        raise NotConnected(self.broken or self._worker.health().detail or "it does not start", hint=self._hint)

    def _until(self, holds: Callable[[], object], cut: Cut, seconds: float) -> bool:
        """Wait until ``holds`` is true, for some seconds at most; False when it is not. Raises NotConnected.

        It also ends when it is broken off, and raises when the program dies meanwhile.
        """
        with cut.then(self._wake), self._news:
            self._news.wait_for(lambda: holds() or cut.made or not self._ready, seconds)
            if holds():
                return True
            if not self._ready and not cut.made:
                raise NotConnected(self._worker.health().detail or "it has died", hint=self._hint)
            return False

    def _wake(self) -> None:
        with self._news:
            self._news.notify_all()

    @abstractmethod
    def _take(self, message: Message, body: bytes) -> DeviceStatus | None:
        """Keep what was told, under the lock; return what is to be reported of it, once."""

    # --- the worker's thread ------------------------------------------------------------------------------------------

    def started(self) -> None:
        """Note that it runs; that it is ready, it says itself."""
        self._since = self._clock.now()
        self._handle_program(ProgramEvent.START)

    def received(self, message: Message, body: bytes) -> None:
        """Keep what it says, and wake who waits for that."""
        with self._news:
            notice = self._noted(message, body)
            self._news.notify_all()
        if notice is not None and notice not in self._told:
            self._told.add(notice)
            self._report(notice)

    def _noted(self, message: Message, body: bytes) -> DeviceStatus | None:
        if "ready" in message:
            self._handle_program(ProgramEvent.READY)
            self._deaths = 0
            return None
        if "absent" in message:
            self._absent = f"{self._worker.name}: {message['absent']}"
            return DeviceStatus(self._worker.name, "fault", self._absent, self._hint)
        return self._take(message, body)

    def lost(self, why: str) -> None:  # noqa: ARG002 - the worker reports it
        """Note that it has died."""
        self._deaths += 1
        self._handle_program(ProgramEvent.DIE)
