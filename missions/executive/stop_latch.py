"""Emergency stop by a person: all actuators are stopped at once, and latched until released."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from threading import Thread

from behaviours.run import log
from drivers.api import Base, Device, Latchable
from drivers.errors import DeviceFault

REPLY_TIMEOUT = 0.2
"""Seconds to wait for the confirmation of all parts; a hanging leaf may hold the lock of a driver."""

MAX_KEPT_PRESSES = 64
"""Number of ids of button presses that are kept, so that a press received over two connections counts once."""


class StopLatch:
    """Stops and latches the ``parts`` among ``devices``, from any thread, independent of the tick.

    The ``base`` has its own latch in its driver. The other parts are brought to rest by ``safe_stop``, and refuse
    commands of behaviours: ``permit`` is called before each command, and calls ``permit_first``. ``hold`` pauses the
    mission.
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
        """Text "stopped by NAME" with the person, command or device that stopped; empty if released."""
        self.stop_count = 0
        """Number of stops so far."""
        self._presses: deque[str] = deque(maxlen=MAX_KEPT_PRESSES)  # newest presses

    @property
    def parts(self) -> list[str]:
        """Names of the parts that a stop brings to rest."""
        return [*self._parts]

    def stop(self, by: str, press: str = "") -> list[str]:
        """Stop all parts on behalf of ``by``; return those that confirmed it within ``REPLY_TIMEOUT``.

        The others stop as soon as they can. ``press`` is the id of a button press, or empty. A repeated stop is sent to
        all parts again, and counts as a new one unless it has the ``press`` of an earlier stop.
        """
        if press not in self._presses:
            self.stop_count += 1
            self.reason = f"stopped by {by}"
            self._presses.extend([press] * bool(press))
        remaining, stopped = deque(self._parts), list[str]()
        self.hold(True)  # only sets a flag, so it does not wait for the current tick
        # A blocked leaf may hold a lock that a part needs. So each part has a thread, and each thread stops the parts
        # that remain: usually the first one stops all, without waiting for other threads to start.
        threads: list[Thread] = []
        while remaining and len(threads) < len(self._parts):
            threads.append(Thread(target=self._stop_remaining, args=(remaining, stopped), name="stop", daemon=True))
            threads[-1].start()
        for thread in threads:
            thread.join(REPLY_TIMEOUT / len(threads))
        return [part for part in self._parts if part in stopped]

    def release(self, number: int) -> bool:
        """Release the latch if ``number`` is that of the last stop, else return False. The mission stays paused."""
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
        """Enable all parts that latched themselves after a disconnect, except the base."""
        for part, device in self._devices.items():
            if part != "base" and isinstance(device, Latchable):
                device.enable()

    def permit(self) -> None:
        """Raise DeviceFault while a stop is latched, or if ``permit_first`` refuses commands of behaviours."""
        self._permit_first()
        if self.reason:
            raise DeviceFault(self.reason, hint="mission stop --release --resume")

    def _stop_remaining(self, remaining: deque[str], stopped: list[str]) -> None:
        """Stop one of the ``remaining`` parts after another until none is left; add each to ``stopped``."""
        with suppress(IndexError):
            while True:
                part = remaining.popleft()
                try:
                    self._stop_part(part, stopped)
                except Exception:  # the next part must be stopped all the same
                    log.exception("%s could not be stopped", part)

    def _stop_part(self, part: str, stopped: list[str]) -> None:
        if part == "base" and self._base is not None:
            self._base.latch(self.reason)
        else:
            self._safe_stop(frozenset({part}))
        stopped.append(part)
