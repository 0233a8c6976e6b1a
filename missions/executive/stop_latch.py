"""The stop that a person asks for: every actuator still, at once, until somebody releases it."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from drivers.api import Base, Device, Latching
from drivers.errors import DeviceFault
from missions.executive.watchdog import attempt_all

REPLY_TIME = 0.2
"""Seconds for which a stop waits to hear that the actuators were told: a leaf that hangs may hold a driver's lock."""


class StopLatch:
    """Latches the ``stilled`` among ``devices`` still, from any thread, whatever the tick does.

    The ``base`` has a latch of its own, in its driver; the others stop safely, by the names of their parts, and take no
    command of a behaviour: ``permit`` is asked before each, and asks ``before``. ``hold`` keeps the mission where it
    is.
    """

    def __init__(
        self,
        devices: Mapping[str, Device],
        stilled: Sequence[str],
        base: Base | None,
        safe_stop: Callable[[frozenset[str]], None],
        hold: Callable[[bool], None],
        before: Callable[[], None],
    ) -> None:
        self._devices, self._parts, self._base, self._safe_stop = devices, stilled, base, safe_stop
        self._hold, self._before = hold, before
        self.reason = ""
        """Who has stopped it; empty while nobody has."""
        self.number = 0
        """How many stops there were."""

    def stop(self, by: str) -> list[str]:
        """Stop for ``by``; return the parts that were told within ``REPLY_TIME``. The others are told when they can be.

        Again while it is stopped, all are told once more, and it counts as another stop.
        """
        self.reason = f"stopped by {by}"
        self.number += 1
        parts = list(self._parts)
        told: list[str] = []
        self._hold(True)  # which only sets a flag: a tick that goes on is not waited for
        # Each on a thread of its own: a leaf that hangs may hold what it waits for.
        threads = attempt_all({part: partial(self._still, part, told) for part in parts})
        for thread in threads.values():
            thread.join(REPLY_TIME / len(threads))
        return [part for part in parts if part in told]

    def release(self, number: int) -> bool:
        """Release the stop of this number, if that is the last one; the mission stays paused. Say whether it was."""
        if not self.reason or number != self.number:
            return False
        if self._base is not None:
            self._base.enable()
        self.enable()
        self.reason = ""
        self._hold(False)
        return True

    def enable(self) -> None:
        """Enable what stands still because it was away, but for the base."""
        for part, device in self._devices.items():
            if part != "base" and isinstance(device, Latching):
                device.enable()

    def permit(self) -> None:
        """Raise DeviceFault where a behaviour is not to set an actuator moving now."""
        self._before()
        if self.reason:
            raise DeviceFault(self.reason, hint="mission stop --release")

    def _still(self, part: str, told: list[str]) -> None:
        if part == "base" and self._base is not None:
            self._base.latch(self.reason)
        else:
            self._safe_stop(frozenset({part}))
        told.append(part)
