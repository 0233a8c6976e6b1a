"""Serial ports without a system behind them: opened by name, in one thread, on a clock that goes on by waiting alone.

The bytes are those of a wire and the programs those that open real ports; only the time is not, and nothing waits.
"""

from collections.abc import Callable
from typing import Any

import pytest

from drivers.clock import ManualClock
from drivers.transport import adapter
from drivers.transport.ports import SerialPort, open_port
from drivers.virtual.terminal import MultiRateDevice, TimedDevice, WireDevice, baud_rates_match

STEP = 0.001
"""Seconds between two looks at a device that does not say when it will speak."""


class Sockets:
    """Where virtual devices are plugged in under a path; whoever opens another one opens that of the system.

    It is for what asks a port itself and waits for the answer. Programs that are given ``clock`` wait on it.
    """

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.clock = ManualClock()
        self.devices: dict[str, WireDevice] = {}
        patch.setattr("drivers.finding.port_probe.open_port", self._open)
        patch.setattr("drivers.transport.ports.open_port", self._open)
        serial = adapter.SerialTransport
        patch.setattr(
            "drivers.transport.adapter.SerialTransport",
            lambda who, port, clock: _Line(port) if isinstance(port, _Port) else serial(who, port, clock),
        )

    def _open(self, who: str, port: str, baud: int, **others: Any) -> "_Port | SerialPort":
        device = self.devices.get(port)
        return open_port(who, port, baud, **others) if device is None else _Port(device, baud, self.clock)


class _Port:
    """One that is open: what is used of a ``drivers.transport.ports.SerialPort``."""

    port = ""

    def __init__(self, device: WireDevice, baud: int, clock: ManualClock) -> None:
        self._device, self._clock = device, clock
        self._heard = b""
        self.baudrate = baud

    @property
    def baudrate(self) -> int:
        return self._baud

    @baudrate.setter
    def baudrate(self, baud: int) -> None:
        self._baud = baud
        if isinstance(self._device, MultiRateDevice):
            self._device.set_baud(baud)

    def read_available(self, timeout: float) -> bytes:
        end = self._clock.now() + timeout
        self._take(self._device.poll(self._clock.now()))
        while not self._heard and self._clock.now() < end:
            due = self._device.next_poll_time() if isinstance(self._device, TimedDevice) else self._clock.now() + STEP
            self._clock.advance_to(end if due is None else min(due, end))
            self._take(self._device.poll(self._clock.now()))
        heard, self._heard = self._heard, b""
        return heard

    def write(self, data: bytes) -> None:
        if data and baud_rates_match(self._baud, self._device.baud):
            self._take(self._device.feed(data, self._clock.now()))

    def reset_input_buffer(self) -> None:
        self._heard = b""

    def set_low_latency_mode(self, mode: bool) -> None:
        raise NotImplementedError

    def set_dtr(self, *, on: bool) -> None: ...

    def close(self) -> None: ...

    def _take(self, said: bytes) -> None:
        self._heard += said if baud_rates_match(self._baud, self._device.baud) else b""


class _Line:
    """A ``drivers.transport.adapter.BusTransport`` to one."""

    latency = 0.0

    def __init__(self, port: _Port) -> None:
        self._port = port
        self.send: Callable[[bytes], None] = port.write

    def receive(self, until: float) -> bytes:
        return self._port.read_available(until - self._port._clock.now())

    def set_baud(self, baud: int) -> None:
        self._port.baudrate = baud
        self._port.reset_input_buffer()

    def reduce_latency(self) -> None: ...

    def close(self) -> None: ...
