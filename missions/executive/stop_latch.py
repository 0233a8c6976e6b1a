"""The stop that a person asks for: every actuator still, at once, until somebody releases it."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from threading import Thread

from behaviours.run import log
from drivers.api import Base, Device, Latchable
from drivers.errors import DeviceFault

REPLY_TIMEOUT = 0.2
"""Seconds for which a stop waits to hear that the actuators were told: a leaf that hangs may hold a driver's lock."""

MAX_KEPT_PRESSES = 64
"""Presses of one latch that are remembered: each counts as one stop, by however many ways it comes."""


class StopLatch:
    """Latches the ``stilled`` among ``devices`` still, from any thread, whatever the tick does.

    The ``base`` has a latch of its own, in its driver; the others stop safely, by the names of their parts, and take no
    command of a behaviour: ``permit`` is asked before each, and asks ``before``. ``hold`` keeps the mission where it
    is.
    """

    def __init__(
        self,
        devices: Mapping[str, Device],
        parts: Sequence[str],
        base: Base | None,
        safe_stop: Callable[[frozenset[str]], None],
        hold: Callable[[bool], None],
        permit_first: Callable[[], None],
    ) -> None:
        self._devices, self._parts, self._base, self._safe_stop = devices, parts, base, safe_stop
        self.hold, self._permit_first = hold, permit_first
        self.reason = ""
        """Who has stopped it; empty while nobody has."""
        self.stop_count = 0
        """How many stops there were."""
        self._presses: deque[str] = deque(maxlen=MAX_KEPT_PRESSES)  # of those that are latched

    @property
    def parts(self) -> list[str]:
        """The parts that a stop makes still."""
        return [*self._parts]

    def stop(self, by: str, press: str = "") -> list[str]:
        """Stop for ``by``; return the parts that were told within ``REPLY_TIMEOUT``. The others are told when they can be.

        Again while it is stopped, all are told once more, and it counts as another stop, unless it is a
        ``press`` that has come another way.
        """
        if press not in self._presses:
            self.stop_count += 1
            self.reason = f"stopped by {by}"
            self._presses.extend([press] * bool(press))
        left, told = deque(self._parts), list[str]()
        self.hold(True)  # which only sets a flag: a tick that goes on is not waited for
        # A leaf that hangs may hold what a part waits for. So there is a thread for each, and each does all that is
        # left: mostly the first one does it all, and the last part waits for no thread to be started on a busy machine.
        threads: list[Thread] = []
        while left and len(threads) < len(self._parts):
            threads.append(Thread(target=self._stop_remaining, args=(left, told), name="stop", daemon=True))
            threads[-1].start()
        for thread in threads:
            thread.join(REPLY_TIMEOUT / len(threads))
        return [part for part in self._parts if part in told]

    def release(self, number: int) -> bool:
        """Release the stop of this number, if that is the last one; the mission stays paused. Say whether it was."""
        if not self.reason or number != self.stop_count:
            return False
        if self._base is not None:
            self._base.enable()
        self.enable()
        self.reason = ""
        self._presses.clear()
        self.hold(False)
        return True

    def enable(self) -> None:
        """Enable what stands still because it was away, but for the base."""
        for part, device in self._devices.items():
            if part != "base" and isinstance(device, Latchable):
                device.enable()

    def permit(self) -> None:
        """Raise DeviceFault where a behaviour is not to set an actuator moving now."""
        self._permit_first()
        if self.reason:
            raise DeviceFault(self.reason, hint="mission stop --release")

    def _stop_remaining(self, remaining: deque[str], stopped: list[str]) -> None:
        """Make still what no other thread has taken yet."""
        with suppress(IndexError):
            while True:
                part = remaining.popleft()
                try:
                    self._stop_part(part, stopped)
                except Exception:  # the next part must stand still all the same
                    log.exception("%s could not be made to hold still", part)

    def _stop_part(self, part: str, stopped: list[str]) -> None:
        if part == "base" and self._base is not None:
            self._base.latch(self.reason)
        else:
            self._safe_stop(frozenset({part}))
        stopped.append(part)
