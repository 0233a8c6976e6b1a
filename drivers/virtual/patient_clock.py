"""The machine's clock for a robot that is simulated in real time: it waits for the virtual devices.

A real device has a processor of its own. A virtual one shares this machine with everything else on it, and is late when
that is busy: it would seem to have been silent, or without power. On this clock no time passes while one is held up, so
that a simulation on a busy machine becomes slow, and not wrong.
"""

from threading import Lock

from drivers.clock import Clock, SystemClock

MAX_DEVICE_DELAY = 0.03
"""Seconds that a device may be late before time stands still: less than any driver waits for an answer on a wire."""


class PatientClock:
    """Seconds since it was made, but for those in which somebody whom it waits for was held up; thread-safe."""

    def __init__(self, machine: Clock | None = None) -> None:
        self._machine = SystemClock() if machine is None else machine
        self._lock = Lock()
        self._stopped_time = 0.0  # seconds in which somebody was held up
        self._last = 0.0
        self._heartbeats: dict[object, float] = {}  # when each whom it waits for was last there

    def now(self) -> float:
        """Return the time in seconds: at most ``MAX_DEVICE_DELAY`` after everybody whom it waits for was last there."""
        with self._lock:
            return self._now()

    def heartbeat(self, device: object) -> None:
        """Wait for ``who`` from now on; to be said again and again, as long as it is not held up."""
        with self._lock:
            self._heartbeats[device] = self._now()

    def unregister(self, device: object) -> None:
        """Wait for ``who`` no more."""
        with self._lock:
            self._heartbeats.pop(device, None)

    def _now(self) -> float:
        now = self._machine.now() - self._stopped_time
        if self._heartbeats and (late := now - min(self._heartbeats.values()) - MAX_DEVICE_DELAY) > 0:
            self._stopped_time += late
            now -= late
        self._last = max(self._last, now)
        return self._last
