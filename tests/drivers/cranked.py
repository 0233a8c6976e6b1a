"""Drivers whose threads are turned by hand, and wires without a port: real driver, virtual device, simulated time.

The bytes are those of the wire and the turns those of the threads; only the time is not, and nothing waits.
"""

import errno
from collections.abc import Callable
from functools import partial
from typing import Protocol, runtime_checkable

from drivers.api import StatusCallback, ignore
from drivers.sim.timeline import Timeline
from drivers.transport.link import SerialLink
from drivers.transport.loop import LoopBody
from drivers.transport.ports import make_port_error
from drivers.virtual.terminal import PoweredDevice, WireDevice

PERIOD = 0.005
"""Seconds between two looks at a wire, as on a pseudo-terminal, and the least between two turns."""


class HandLoop:
    """A ``drivers.transport.loop.Loop`` whose turns are taken as a timeline comes to them."""

    def __init__(self, timeline: Timeline, turn: LoopBody, last: Callable[[], object]) -> None:
        self.is_alive = False
        self._timeline = timeline
        self._turn = turn
        self._last = last
        self._starts = 0

    def start(self) -> None:
        if not self.is_alive:
            self.is_alive = True
            self._starts += 1
            self._timeline.call_at(self._timeline.clock.now(), partial(self._again, self._starts))

    def wake(self) -> None:
        if self.is_alive:
            self._starts += 1
            self._timeline.call_at(self._timeline.clock.now(), partial(self._again, self._starts))

    def end(self) -> None:
        if self.is_alive:
            self.is_alive = False
            self._last()

    def _again(self, start: int) -> None:
        if self.is_alive and start == self._starts:
            pause = self._turn()
            self._timeline.call_at(self._timeline.clock.now() + max(pause, PERIOD), partial(self._again, start))


def by_hand(timeline: Timeline) -> Callable[[str, LoopBody, Callable[[], object]], HandLoop]:
    """Return what makes loops that are turned as ``timeline`` goes on: a ``drivers.transport.loop.LoopFactory``."""
    return lambda name, turn, last: HandLoop(timeline, turn, last)  # noqa: ARG005 - no thread, no name


def pass_until(timeline: Timeline, holds: Callable[[], object]) -> None:
    """Let time pass until ``holds`` is true; fail after 20 s of it."""
    end = timeline.clock.now() + 20.0
    while not holds():
        assert timeline.clock.now() < end, "it did not come true within 20 s"
        timeline.run_until(timeline.clock.now() + PERIOD)


@runtime_checkable
class WithDtr(Protocol):
    """A device to which the modem line DTR matters."""

    def open_port(self, now: float) -> None: ...

    def close_port(self, *, hangs_up: bool) -> None: ...


class HandWire:
    """A wire from a virtual device to a link, which looks at it every ``PERIOD``.

    ``distort`` sees all bytes that the device sends, and returns what arrives instead.
    """

    def __init__(self, device: WireDevice, timeline: Timeline, *, plugged: bool = True) -> None:
        self.distort: Callable[[bytes], bytes] = bytes
        self.arrived = b""
        self.device = device
        self.clock = timeline.clock
        self.holder: HandPort | None = None
        self._timeline = timeline
        self._plugged = plugged
        timeline.call_every(PERIOD, self._poll)

    def link(self, name: str, *, gather: float = 0.0, report: StatusCallback = ignore) -> SerialLink:
        """Return a link to the device."""
        loop, baud = by_hand(self._timeline), self.device.baud
        return SerialLink(
            name,
            f"/dev/{name}",
            baud,
            retry_interval=0.05,
            gather_time=gather,
            report=report,
            opener=self.dial,
            make_loop=loop,
        )

    def dial(self, who: str, port: str, baud: int) -> "HandPort":
        """Take the port, as a link does."""
        assert baud == self.device.baud
        if not self._plugged:
            raise make_port_error(who, port, FileNotFoundError(errno.ENOENT, "no such file"))
        self.arrived, self.holder = b"", HandPort(self)
        if isinstance(self.device, WithDtr):
            self.device.open_port(self.clock.now())
        return self.holder

    def unplug(self) -> None:
        """Pull the plug: the port has gone, and with it DTR."""
        self._plugged, self.holder = False, None
        if isinstance(self.device, WithDtr):
            self.device.close_port(hangs_up=True)

    def come_back(self) -> None:
        """Have the port there again, of a device that had power all the while."""
        self._plugged = True

    def plug_in(self) -> None:
        self._plugged = True
        if isinstance(self.device, PoweredDevice):
            self.device.power_on(self.clock.now())

    def take(self, said: bytes) -> None:
        """Pass on what the device says, to whoever has the port."""
        if said and self.holder is not None:
            self.arrived += self.distort(said)

    def _poll(self) -> None:
        self.take(self.device.poll(self.clock.now()))


class HandPort:
    """A ``drivers.transport.link.LinkPort`` at the end of a ``HandWire``."""

    def __init__(self, wire: HandWire) -> None:
        self._wire = wire
        self._hangs_up = True  # as Linux does unless HUPCL is off

    def read_available(self, timeout: float) -> bytes:  # noqa: ARG002 - the time is in other hands
        self._require()
        data, self._wire.arrived = self._wire.arrived, b""
        return data

    def write(self, data: bytes) -> None:
        self._require()
        self._wire.take(self._wire.device.feed(data, self._wire.clock.now()))

    def set_dtr(self, *, on: bool) -> None:
        self._require()
        self._hangs_up = not on

    def close(self) -> None:
        if self._wire.holder is self:
            self._wire.holder = None
            if isinstance(self._wire.device, WithDtr):
                self._wire.device.close_port(hangs_up=self._hangs_up)

    def _require(self) -> None:
        if self._wire.holder is not self:
            raise OSError(errno.EIO, "it was unplugged")
