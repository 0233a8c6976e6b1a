"""A line without a port: virtual servos and the bus in one thread, on a clock that stands still but for their waiting.

The bytes are those of the real bus and the real chain; only the time is not. What needs minutes on a wire runs in
seconds, and always in the same way.
"""

import errno
from collections.abc import Callable
from typing import Generic, Protocol, Self, TypeVar

from drivers.clock import Clock, ManualClock
from drivers.servos.bus import ServoBus
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.transport.ports import make_port_error
from drivers.virtual.terminal import MultiRateDevice, TimedDevice, WireDevice


class Servos(WireDevice, TimedDevice, MultiRateDevice, Protocol):
    """What a chain of servos is to its line."""


S = TypeVar("S", bound=Servos)


class DirectLine(Generic[S]):
    """A ``drivers.transport.adapter.BusTransport`` with a virtual chain at its end. ``sent`` keeps what was sent.

    ``distort`` sees all bytes that the chain sends, and returns what arrives instead.
    """

    def __init__(self, chain: S, clock: ManualClock, *, latency: float = 0.0) -> None:
        self.distort: Callable[[bytes], bytes] = bytes
        self.chain = chain
        self.latency = latency
        self.sent: list[bytes] = []
        self.plugged = True
        self._clock = clock
        self._heard = b""

    def dial(self, who: str, port: str, baud: int, clock: Clock) -> Self:
        """Be the line that is opened."""
        if not self.plugged:
            raise make_port_error(who, port, FileNotFoundError(errno.ENOENT, "no such file"))
        assert clock is self._clock
        self.chain.set_baud(baud)
        return self

    def send(self, data: bytes) -> None:
        self._require()
        self.sent.append(data)
        self._take(self.chain.feed(data, self._clock.now()))

    def receive(self, until: float) -> bytes:
        self._require()
        self.poll()
        while not self._heard and self._clock.now() < until:
            due = self.chain.next_poll_time()
            self._clock.advance_to(until if due is None else min(due, until))
            self.poll()
        heard, self._heard = self._heard, b""
        return heard

    def poll(self) -> None:
        """Let the servos go on although nobody asks them."""
        self._take(self.chain.poll(self._clock.now()))

    def set_baud(self, baud: int) -> None:
        self._require()
        self.chain.set_baud(baud)

    def close(self) -> None:
        self._heard = b""

    def _take(self, said: bytes) -> None:
        self._heard += self.distort(said) if said else b""

    def _require(self) -> None:
        if not self.plugged:
            raise make_port_error("arm", "/dev/servos", OSError(errno.EIO, "it was unplugged"))


def direct_bus(
    chain: VirtualServoBus, *, baud: int = 1_000_000, patience: float = 0.004, latency: float = 0.0
) -> tuple[ServoBus, DirectLine[VirtualServoBus], ManualClock]:
    """Return a bus that is open on ``chain``, its line, and their clock."""
    clock = ManualClock()
    line = DirectLine(chain, clock, latency=latency)
    bus = ServoBus("/dev/servos", clock, baud=baud, name="arm", reply_timeout=patience, dial=line.dial)
    bus.open()
    return bus, line, clock
