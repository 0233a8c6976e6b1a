"""The serial port as the Dynamixel SDK's packet handler wants it: a replacement for the SDK's own PortHandler.

The original waits in a busy loop for a fixed 34 ms, on a wall clock that may jump, and cannot open a port for itself
alone. This one waits in ``select`` for as long as the reply can take.
"""

# ruff: noqa: N802 - the packet handler calls its port by these names

import select
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import serial

from drivers.clock import Clock

RETURN_DELAY = 254 * 2e-6
"""Seconds: the longest delay that a servo can be set to before it replies."""

_ADAPTERS = Path("/sys/bus/usb-serial/devices")


class Port:
    """One open serial line, for one transaction at a time.

    ``patience`` (seconds) is what a reply may take beyond its own bytes and the return delay.
    """

    def __init__(self, line: serial.Serial, clock: Clock, patience: float) -> None:
        self.is_using = False  # the packet handler's flag; its owner clears it after every transaction
        self._line = line
        self._clock = clock
        self._patience = patience
        self._heard = bytearray()
        self._sent = 0
        self._deadline = 0.0
        self._expired = True

    def clearPort(self) -> None:
        """Forget what has arrived so far."""
        self._heard.clear()
        self._line.reset_input_buffer()

    def writePort(self, packet: Sequence[int]) -> int:
        """Send a packet; return how many bytes went out."""
        self._sent = len(packet)
        return self._line.write(bytes(packet)) or 0

    def setPacketTimeout(self, packet_length: int) -> None:
        """Give a reply of ``packet_length`` bytes its time: ten bits a byte, for the request still leaving too."""
        wire = (self._sent + packet_length) * 10 / self._line.baudrate
        self._deadline = self._clock.now() + wire + RETURN_DELAY + self._patience
        self._expired = False

    def isPacketTimeout(self) -> bool:
        """True once the time of the reply is over and all that arrived in it was handed out."""
        return self._expired

    def readPort(self, length: int) -> bytes:
        """Return ``length`` bytes; fewer when the time is up.

        The line is looked at once more after the deadline: we may have been late, not the servo.
        """
        while len(self._heard) < length and not self._expired:
            remaining = self._deadline - self._clock.now()
            ready, _, _ = select.select([self._line.fileno()], [], [], max(0.0, remaining))
            self._expired = remaining <= 0 or not ready
            if ready:
                self._heard += self._line.read(256)
        taken = bytes(self._heard[: max(0, length)])
        del self._heard[: len(taken)]
        return taken


def timer_of(port: str, *, adapters: Path = _ADAPTERS) -> Path:
    """Return the file with the milliseconds for which a USB adapter may hold bytes back; many have none."""
    return adapters / Path(port).resolve().name / "latency_timer"


def quicken(line: serial.Serial, *, adapters: Path = _ADAPTERS) -> float:
    """Ask a USB adapter not to hold bytes back; return for how long it still may, in seconds (0 if it has no timer)."""
    with suppress(ValueError, OSError, NotImplementedError):  # only some know how; the timer tells what came of it
        line.set_low_latency_mode(True)
    try:
        return int(timer_of(line.port or "", adapters=adapters).read_text()) / 1000
    except (OSError, ValueError):
        return 0.0
