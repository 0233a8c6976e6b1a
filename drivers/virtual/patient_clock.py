"""Clock for simulation in real time that stops while a virtual device is delayed.

A virtual device shares the processor with all other programs. On a busy computer it replies late, and would seem
disconnected. On this clock no time passes meanwhile, so a simulation on a busy computer is slow, but correct.
"""

from threading import Lock

from drivers.clock import Clock, SystemClock

MAX_DEVICE_DELAY = 0.03
"""Seconds by which a device may be late before the clock stops: less than any driver's reply timeout."""


class PatientClock:
    """Seconds since its creation, minus those in which a registered device was delayed; thread-safe."""

    def __init__(self, machine: Clock | None = None) -> None:
        self._machine = SystemClock() if machine is None else machine
        self._lock = Lock()
        self._stopped_time = 0.0  # total seconds in which a device was delayed
        self._last = 0.0
        self._heartbeats: dict[object, float] = {}  # time of the last heartbeat by device

    def now(self) -> float:
        """Return the time in seconds; it is at most ``MAX_DEVICE_DELAY`` after the oldest heartbeat of a device."""
        with self._lock:
            return self._now()

    def heartbeat(self, device: object) -> None:
        """Register ``device``, or store that it is not delayed. Each device calls this repeatedly."""
        with self._lock:
            self._heartbeats[device] = self._now()

    def unregister(self, device: object) -> None:
        """Remove ``device``."""
        with self._lock:
            self._heartbeats.pop(device, None)

    def _now(self) -> float:
        now = self._machine.now() - self._stopped_time
        if self._heartbeats and (late := now - min(self._heartbeats.values()) - MAX_DEVICE_DELAY) > 0:
            self._stopped_time += late
            now -= late
        self._last = max(self._last, now)
        return self._last
