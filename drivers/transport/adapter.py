"""The serial adapter of a bus: bytes out, and bytes in as soon as they are there."""

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
"""Seconds for which a line may take no bytes before it counts as gone."""

_READ_SIZE = 4096


class BusTransport(Protocol):
    """An open line with servos on it. All but ``close`` raise NotConnected when it is gone."""

    @property
    def latency(self) -> float:
        """Seconds for which the adapter may hold back what it has received."""
        ...

    def send(self, data: bytes) -> None:
        """Send ``data`` whole."""
        ...

    def receive(self, until: float) -> bytes:
        """Return what has arrived, as soon as there is something; nothing when the clock shows ``until`` first.

        With a time that is over it returns what is there already.
        """
        ...

    def set_baud(self, baud: int) -> None:
        """Go on at another rate."""
        ...

    def close(self) -> None:
        """Release the port."""
        ...


TransportOpener = Callable[[str, str, int, Clock], BusTransport]
"""Opens a line for somebody: who, which port, baud rate, clock. Raises NotConnected, with what to try."""


class SerialTransport:
    """A serial port that this process alone has open: a ``BusTransport`` that waits in ``select``, never in a loop."""

    def __init__(self, part: str, port: "serial.Serial", clock: Clock) -> None:
        self.latency = 0.0
        self._part = part
        self._port = port
        self._number = port.fileno()
        self._clock = clock

    def send(self, data: bytes) -> None:
        """Send ``data`` whole. A line that takes none of it for ``_WRITE_TIMEOUT`` seconds is gone."""
        try:
            while data:
                with suppress(BlockingIOError):
                    data = data[os.write(self._number, data) :]
                if data and not select.select([], [self._number], [], _WRITE_TIMEOUT)[1]:
                    raise OSError(errno.EIO, "it takes no more bytes")
        except OSError as error:
            raise self._port_error(error) from error

    def receive(self, until: float) -> bytes:
        """Return what has arrived by ``until``.

        The line is looked at once more when that is over: it may be we who are late, not the servo.
        """
        try:
            while not select.select([self._number], [], [], max(0.0, until - self._clock.now()))[0]:
                if self._clock.now() >= until:  # else the clock waits, for a virtual servo that is held up
                    return b""
            if data := os.read(self._number, _READ_SIZE):
                return data
            raise OSError(errno.EIO, "it was unplugged")  # readable, and nothing to read: the other end is gone
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._port_error(error) from error

    def set_baud(self, baud: int) -> None:
        """Go on at another rate, without letting go of the port."""
        try:
            self._port.baudrate = baud
            self._port.reset_input_buffer()
        except (OSError, ValueError, termios.error) as error:
            raise self._port_error(error) from error

    def close(self) -> None:
        """Release the port, which may be gone already."""
        with suppress(OSError, termios.error):
            self._port.close()

    def reduce_latency(self) -> None:
        """Ask the adapter not to hold bytes back, and note for how long it still may."""
        self.latency = reduce_latency(self._port)

    def _port_error(self, error: BaseException) -> NotConnected:
        from drivers.transport.ports import make_port_error  # noqa: PLC0415 - as in ``open_transport``

        return make_port_error(self._part, str(self._port.port), error)


def open_transport(part: str, port: str, baud: int, clock: Clock) -> SerialTransport:
    """Open a serial port for this process alone. Raises NotConnected, with what to try."""
    from drivers.transport.ports import open_port  # noqa: PLC0415 - a simulated bus opens no port

    line = SerialTransport(part, open_port(part, port, baud, timeout=0), clock)
    line.reduce_latency()
    return line


def latency_timer_path(port: str, *, adapters: Path = _ADAPTERS) -> Path:
    """Return the file with the milliseconds for which a USB adapter may hold bytes back; many have none."""
    return adapters / Path(port).resolve().name / "latency_timer"


def reduce_latency(port: "serial.Serial", *, adapters: Path = _ADAPTERS) -> float:
    """Ask a USB adapter not to hold bytes back; return for how long it still may, in seconds (0 if it has no timer)."""
    with suppress(ValueError, OSError, NotImplementedError):  # only some know how; the timer tells what came of it
        port.set_low_latency_mode(True)
    try:
        return int(latency_timer_path(port.port or "", adapters=adapters).read_text()) / 1000
    except (OSError, ValueError):
        return 0.0
