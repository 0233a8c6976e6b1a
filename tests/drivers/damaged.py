"""A wire on which mishaps befall lines both ways, by chance but repeatably."""

from tests.drivers.cranked import HandWire
from tests.drivers.fault_injection import MAX_PAUSE, FaultInjection

MISHAPS = {"drop": 0.01, "truncate": 0.01, "flip": 0.01, "split": 0.01, "late": 0.01, "noise": 0.01, "echo": 0.01}
"""The share of lines that each befalls."""


class Damaged:
    """A wire on which mishaps befall every line, whichever way it goes."""

    def __init__(self, bench_wire: HandWire, seed: int) -> None:
        self.faults = FaultInjection(seed, **MISHAPS)
        self._wire = bench_wire
        self._waiting: list[tuple[float, bytes]] = []  # what comes late, and then between other lines
        device = bench_wire.device
        self._feed, device.feed = device.feed, self.feed  # type: ignore[method-assign]
        bench_wire.distort = self.distort

    def distort(self, said: bytes) -> bytes:
        return self._passed(said)

    def feed(self, data: bytes, now: float) -> bytes:
        return self._feed(self._passed(data), now)

    def _passed(self, data: bytes) -> bytes:
        now, passed = self._wire.clock.now(), b""
        for line in data.splitlines(keepends=True):
            for late, piece in self.faults.disturb(line):
                if late <= MAX_PAUSE:
                    passed += piece
                else:
                    self._waiting.append((now + late, piece))
            if self.faults.echoes():
                passed += line
        passed += b"".join(piece for at, piece in self._waiting if at <= now)
        self._waiting = [(at, piece) for at, piece in self._waiting if at > now]
        return passed
