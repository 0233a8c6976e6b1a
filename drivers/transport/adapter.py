"""Transport of a servo bus: a serial adapter with the lowest possible latency."""

import errno
import os
import select
import termios
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from drivers.clock import Clock
from drivers.errors import NotConnected

if TYPE_CHECKING:  # a simulated bus opens no port
    import serial

_ADAPTERS = Path("/sys/bus/usb-serial/devices")

_WRITE_TIMEOUT = 0.5
"""Seconds for which a write may send no byte, until the port counts as disconnected."""

_READ_SIZE = 4096


class BusTransport(Protocol):
    """Open transport to a servo bus. All methods but ``close`` raise NotConnected if it is gone."""

    @property
    def latency(self) -> float:
        """Maximum seconds by which the adapter delays received bytes."""
        ...

    def send(self, data: bytes) -> None:
        """Send ``data`` completely."""
        ...

    def receive(self, until: float) -> bytes:
        """Wait for bytes until the clock reaches ``until``; return them as soon as some arrive, else no bytes.

        If ``until`` is in the past, return the bytes that are already buffered.
        """
        ...

    def set_baud(self, baud: int) -> None:
        """Change the baud rate."""
        ...

    def close(self) -> None:
        """Release the port."""
        ...


TransportOpener = Callable[[str, str, int, Clock], BusTransport]
"""Opens a transport: name of the part, port, baud rate, clock. Raises NotConnected, with a hint."""


class SerialTransport:
    """Serial port, opened exclusively: a ``BusTransport`` that waits in ``select``, without polling."""

    def __init__(self, part: str, port: "serial.Serial", clock: Clock) -> None:
        self.latency = 0.0
        self._part = part
        self._port = port
        self._number = port.fileno()
        self._clock = clock

    def send(self, data: bytes) -> None:
        """Send ``data`` completely. Raises NotConnected after ``_WRITE_TIMEOUT`` seconds without progress."""
        try:
            while data:
                with suppress(BlockingIOError):
                    data = data[os.write(self._number, data) :]
                if data and not select.select([], [self._number], [], _WRITE_TIMEOUT)[1]:
                    raise OSError(errno.EIO, "the port accepts no more bytes")
        except OSError as error:
            raise self._port_error(error) from error

    def receive(self, until: float) -> bytes:
        """Wait for bytes until the clock reaches ``until``; return them as soon as some arrive, else no bytes.

        The port is checked once more after that time, since this process may have been delayed.
        """
        try:
            while not select.select([self._number], [], [], max(0.0, until - self._clock.now()))[0]:
                if self._clock.now() >= until:  # else the clock has stopped, for a delayed virtual servo
                    return b""
            if data := os.read(self._number, _READ_SIZE):
                return data
            raise OSError(errno.EIO, "it was unplugged")  # ready, but without data: the device is gone
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._port_error(error) from error

    def set_baud(self, baud: int) -> None:
        """Change the baud rate without closing the port."""
        try:
            self._port.baudrate = baud
            self._port.reset_input_buffer()
        except (OSError, ValueError, termios.error) as error:
            raise self._port_error(error) from error

    def close(self) -> None:
        """Close the port, which may be gone already."""
        with suppress(OSError, termios.error):
            self._port.close()

    def reduce_latency(self) -> None:
        """Set the adapter to low latency, and read the latency that remains."""
        self.latency = reduce_latency(self._port)

    def _port_error(self, error: BaseException) -> NotConnected:
        from drivers.transport.ports import make_port_error  # noqa: PLC0415 - as in ``open_transport``

        return make_port_error(self._part, str(self._port.port), error)


def open_transport(part: str, port: str, baud: int, clock: Clock) -> SerialTransport:
    """Open a serial port exclusively. Raises NotConnected, with a hint."""
    from drivers.transport.ports import open_port  # noqa: PLC0415 - a simulated bus opens no port

    line = SerialTransport(part, open_port(part, port, baud, timeout=0), clock)
    line.reduce_latency()
    return line


def latency_timer_path(port: str, *, adapters: Path = _ADAPTERS) -> Path:
    """Return the file with the latency timer of a USB adapter in milliseconds; many adapters have none."""
    return adapters / Path(port).resolve().name / "latency_timer"


def reduce_latency(port: "serial.Serial", *, adapters: Path = _ADAPTERS) -> float:
    """Set a USB adapter to low latency; return the latency that remains in seconds (0 without a latency timer)."""
    with suppress(ValueError, OSError, NotImplementedError):  # not supported by all; the timer shows the result
        port.set_low_latency_mode(True)
    try:
        return int(latency_timer_path(port.port or "", adapters=adapters).read_text()) / 1000
    except (OSError, ValueError):
        return 0.0
