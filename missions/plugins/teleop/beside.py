"""A game pad beside a mission: whoever holds its shoulder button has the wheels, and the mission waits."""

from collections.abc import Callable
from threading import Event, Thread

from behaviours.run import log
from drivers.api import Base, DeviceStatus, Health, Report, ignore
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.transport.guard import guarded
from missions.control.pilot import Pilot
from missions.plugins.teleop.layout import UnknownPadError
from missions.plugins.teleop.pad import Pad
from missions.plugins.teleop.turns import drive_by_hand

RETRY = 1.0
"""Seconds between two attempts to find the pad."""


class Beside:
    """A ``drivers.api.Device`` that moves nothing of its own: it reads a pad and commands ``base``, on its own thread.

    ``pad`` makes the pad, plugged in or not: it may be another each time. The head stays the mission's.
    """

    name = "pad"

    def __init__(self, base: Base, pad: Callable[[], Pad], clock: Clock, *, report: Report = ignore) -> None:
        self._pilot = Pilot(base)
        self._pad = pad
        self._clock = clock
        self._report = guarded(report)
        self._ending = Event()
        self._thread: Thread | None = None
        self._health = Health(False, "pad: not opened yet")

    def open(self) -> None:
        """Start looking for the pad; returns at once, whether it is there or not."""
        if self._thread is None:
            self._ending.clear()
            self._thread = Thread(target=self._run, name="pad", daemon=True)
            self._thread.start()

    def rest(self) -> None:
        """Do nothing: the base comes to rest by itself."""

    def close(self) -> None:
        """Let go of the wheels and end the thread. Safe from any state, more than once."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def health(self) -> Health:
        """Say whether the pad is there."""
        return self._health

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                self._serve()
            except NotConnected as error:
                self._lost(str(error), error.hint, refused=isinstance(error, UnknownPadError))
            except Exception as error:  # whatever it is, the pad must not seem to be there
                log.exception("the pad cannot be read")
                self._lost(f"pad: {type(error).__name__}: {error}", "")

    def _lost(self, why: str, hint: str, *, refused: bool = False) -> None:
        """Say once that the pad is not there, or why it is refused, and wait a while."""
        if self._health.online or (refused and why != self._health.detail):
            self._report(DeviceStatus(self.name, "offline", why, hint))
        self._health = Health(False, why, hint)
        self._ending.wait(RETRY)

    def _serve(self) -> None:
        """Pass on what the pad says until it has gone, or all ends."""
        pad = self._pad()
        pad.open()
        self._health = Health(True)
        self._report(DeviceStatus(self.name, "online", f"{pad.path}: a game pad"))
        try:
            drive_by_hand(self._pilot, self._wait, pad, self._clock, _unseen)
        finally:
            pad.close()

    def _wait(self, seconds: float) -> str:
        """Wait; the only key that is ever pressed here is that of the end."""
        return "end" if self._ending.wait(seconds) else ""


def _unseen(line: str) -> None:
    """Show a line to nobody: the mission shows its own."""
    del line
