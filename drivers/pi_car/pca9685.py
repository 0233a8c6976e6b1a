"""A PCA9685 on an I2C bus: sixteen outputs of pulses, fifty times a second.

By the data sheet of NXP (rev. 4): MODE1 at 0 (sleep is bit 4, auto-increment bit 5, restart bit 7), four registers for
each channel from 6 on (on and off counts, low byte first, of 4096; bit 4 of a high byte is always on, or always off),
the prescaler at 254. The chip goes on with what it was told last for as long as it has power, whoever has told it.
"""

from collections.abc import Sequence
from typing import Protocol

MODE1, MODE2, FIRST, PRESCALE = 0x00, 0x01, 0x06, 0xFE
SLEEP, INCREMENT, TOTEM_POLE = 0x10, 0x20, 0x04
ALWAYS = 0x10

FREQUENCY = 50.0
"""Hertz: what hobby servos take; one frequency is that of all channels."""

COUNTS = 4096
PERIOD_US = 1e6 / FREQUENCY

SCALE = round(25e6 / (COUNTS * FREQUENCY)) - 1
"""What the prescaler makes 50 Hz of, from the oscillator within (25 MHz)."""

LEAST_US, MOST_US = 544.0, 2400.0
"""The pulses of 0 and 180 degrees: those of the Arduino's Servo library."""


class Bus(Protocol):
    """What is needed of ``smbus2.SMBus``. Raises OSError where nobody answers."""

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> Sequence[int]:
        """Return the bytes at ``register`` and behind it."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> object:
        """Write them."""
        ...


class Pca9685:
    """The chip at ``address`` of a ``bus``. What its other channels do is left alone."""

    def __init__(self, bus: Bus, address: int) -> None:
        self._bus, self._address = bus, address
        self._kept = False  # it makes the pulses of who had it before

    def wake(self) -> None:
        """Let it make pulses at 50 Hz; one that does so already is left alone, and what it sends is taken for true."""
        (mode,) = self._bus.read_i2c_block_data(self._address, MODE1, 1)
        (scale,) = self._bus.read_i2c_block_data(self._address, PRESCALE, 1)
        self._kept = bool(not mode & SLEEP and mode & INCREMENT and scale == SCALE)
        if self._kept:
            return
        self._write(MODE1, SLEEP | INCREMENT)  # the prescaler is set in its sleep alone
        self._write(PRESCALE, SCALE)
        self._write(MODE2, TOTEM_POLE)
        self._write(MODE1, INCREMENT)

    def share(self, channel: int, share: float) -> None:
        """Have a channel on for that share (0..1) of the time."""
        counts = round(share * COUNTS)
        if counts <= 0:
            self._put(channel, 0, ALWAYS << 8)
        elif counts >= COUNTS:
            self._put(channel, ALWAYS << 8, 0)
        else:
            self._put(channel, 0, counts)

    def degree(self, channel: int, degree: int) -> None:
        """Send the servo on a channel to a degree, 0..180."""
        pulse = LEAST_US + (MOST_US - LEAST_US) * degree / 180
        self._put(channel, 0, round(pulse * COUNTS / PERIOD_US))

    def sent(self, channel: int) -> int | None:
        """Return the degree to which a channel has sent its servo; None where nobody knows.

        That is so after it was switched on, and after somebody had it make other pulses.
        """
        if not self._kept:
            return None
        low, high, off_low, off_high = self._bus.read_i2c_block_data(self._address, FIRST + 4 * channel, 4)
        if low or high or off_high & ALWAYS:
            return None
        pulse = (off_low + 256 * off_high) * PERIOD_US / COUNTS
        degree = round(180 * (pulse - LEAST_US) / (MOST_US - LEAST_US))
        return degree if 0 <= degree <= 180 else None

    def _put(self, channel: int, on: int, off: int) -> None:
        self._write(FIRST + 4 * channel, on & 255, on >> 8, off & 255, off >> 8)

    def _write(self, register: int, *data: int) -> None:
        self._bus.write_i2c_block_data(self._address, register, data)
