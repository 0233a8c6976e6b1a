"""The guardian: a process that holds the pins for a driver, and lets all rest when that falls silent or dies.

Neither pins nor a PCA9685 have a watchdog: they go on with what they were told last. So who tells them is a process of
its own, which hears the driver on its standard input. After ``wire.WATCHDOG_TIMEOUT`` seconds of silence, and at once when that
ends, motors stand and servos stay. It is in a session of its own and obeys no signals of a terminal. What remains:
where this process is killed, too (``kill -9`` of both at once, a kernel that stands still), the motors go on.
"""

import json
import os
import select
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from drivers.clock import SystemClock
from drivers.transport.guardian import ActuatorGuardian, Actuators, GuardianServos, GuardianWheels

# A PCA9685 on an I2C bus: sixteen outputs of pulses, fifty times a second.
#
# By the data sheet of NXP (rev. 4): MODE1 at 0 (sleep is bit 4, auto-increment bit 5, restart bit 7), four registers
# for each channel from 6 on (on and off counts, low byte first, of 4096; bit 4 of a high byte is always on, or always
# off), the prescaler at 254. The chip goes on with what it was told last for as long as it has power, whoever has
# told it.

MODE1, MODE2, FIRST_CHANNEL, PRESCALE = 0x00, 0x01, 0x06, 0xFE
SLEEP, INCREMENT, TOTEM_POLE = 0x10, 0x20, 0x04
ALWAYS = 0x10

FREQUENCY = 50.0
"""Hertz: what hobby servos take; one frequency is that of all channels."""

COUNTS = 4096
PERIOD_US = 1e6 / FREQUENCY

PRESCALE_50_HZ = round(25e6 / (COUNTS * FREQUENCY)) - 1
"""What the prescaler makes 50 Hz of, from the oscillator within (25 MHz)."""

MIN_PULSE_US, MAX_PULSE_US = 544.0, 2400.0
"""The pulses of 0 and 180 degrees: those of the Arduino's Servo library."""


class I2CBus(Protocol):
    """What is needed of ``smbus2.SMBus``. Raises OSError where nobody answers."""

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> Sequence[int]:
        """Return the bytes at ``register`` and behind it."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> object:
        """Write them."""
        ...


class Pca9685:
    """The chip at ``address`` of a ``bus``. What its other channels do is left alone."""

    def __init__(self, bus: I2CBus, address: int) -> None:
        self._bus, self._address = bus, address
        self._was_running = False  # it makes the pulses of who had it before

    def wake(self) -> None:
        """Let it make pulses at 50 Hz; one that does so already is left alone, and what it sends is taken for true."""
        (mode,) = self._bus.read_i2c_block_data(self._address, MODE1, 1)
        (scale,) = self._bus.read_i2c_block_data(self._address, PRESCALE, 1)
        self._was_running = bool(not mode & SLEEP and mode & INCREMENT and scale == PRESCALE_50_HZ)
        if self._was_running:
            return
        self._write(MODE1, SLEEP | INCREMENT)  # the prescaler is set in its sleep alone
        self._write(PRESCALE, PRESCALE_50_HZ)
        self._write(MODE2, TOTEM_POLE)
        self._write(MODE1, INCREMENT)

    def set_duty_cycle(self, channel: int, share: float) -> None:
        """Have a channel on for that share (0..1) of the time."""
        counts = round(share * COUNTS)
        if counts <= 0:
            self._set_counts(channel, 0, ALWAYS << 8)
        elif counts >= COUNTS:
            self._set_counts(channel, ALWAYS << 8, 0)
        else:
            self._set_counts(channel, 0, counts)

    def set_angle(self, channel: int, degree: int) -> None:
        """Send the servo on a channel to a degree, 0..180."""
        pulse = MIN_PULSE_US + (MAX_PULSE_US - MIN_PULSE_US) * degree / 180
        self._set_counts(channel, 0, round(pulse * COUNTS / PERIOD_US))

    def read_angle(self, channel: int) -> int | None:
        """Return the degree to which a channel has sent its servo; None where nobody knows.

        That is so after it was switched on, and after somebody had it make other pulses.
        """
        if not self._was_running:
            return None
        low, high, off_low, off_high = self._bus.read_i2c_block_data(self._address, FIRST_CHANNEL + 4 * channel, 4)
        if low or high or off_high & ALWAYS:
            return None
        pulse = (off_low + 256 * off_high) * PERIOD_US / COUNTS
        degree = round(180 * (pulse - MIN_PULSE_US) / (MAX_PULSE_US - MIN_PULSE_US))
        return degree if 0 <= degree <= 180 else None

    def _set_counts(self, channel: int, on: int, off: int) -> None:
        self._write(FIRST_CHANNEL + 4 * channel, on & 255, on >> 8, off & 255, off >> 8)

    def _write(self, register: int, *data: int) -> None:
        self._bus.write_i2c_block_data(self._address, register, data)


# What a guardian on a Raspberry Pi has in its hands: motors on pins, motors and servos on a PCA9685.

MotorSetter = Callable[[float], None]
"""Turns a motor at a share of its full power, -1..1."""


def make_actuators(config: Mapping[str, Any]) -> Actuators:
    """Return what a section of a robot file is about. Raises ImportError, OSError and what gpiozero raises."""
    if "pan" in config:
        return make_servos(open_pca9685(config), config["pan"], config["tilt"])
    if config["motors"] == "gpio":
        return make_wheels(make_pin_motor(config["left"]), make_pin_motor(config["right"]))
    board = open_pca9685(config)
    return make_wheels(make_channel_motor(board, config["left"]), make_channel_motor(board, config["right"]))


def make_wheels(left: MotorSetter, right: MotorSetter) -> GuardianWheels:
    """Return two motors, which stand."""

    def turn(one: float, other: float) -> None:
        try:
            left(one)
        finally:  # where one cannot be told, the other is all the same
            right(other)

    return GuardianWheels(turn)


def make_servos(board: Pca9685, pan: int, tilt: int) -> GuardianServos:
    """Return two servos, where the chip has sent them."""
    channels = (pan, tilt)

    def pulse(number: int, degree: int) -> None:
        board.set_angle(channels[number], degree)

    standing = board.read_angle(pan), board.read_angle(tilt)
    for channel, degree in zip(channels, standing, strict=True):
        if degree is None:
            board.set_duty_cycle(channel, 0.0)  # no pulse at all, so that the next guardian knows no more than this one
    return GuardianServos(pulse, standing)


def open_pca9685(config: Mapping[str, Any]) -> Pca9685:
    """Return a PCA9685 that makes pulses."""
    from smbus2 import SMBus  # noqa: PLC0415 - an optional dependency, of those who have one

    bus: I2CBus = SMBus(config["bus"])
    board = Pca9685(bus, config["address"])
    board.wake()
    return board


def make_pin_motor(pins: Mapping[str, int | None]) -> MotorSetter:
    """Return a motor on pins of the computer."""
    from gpiozero import DigitalOutputDevice, Motor, PWMOutputDevice  # noqa: PLC0415 - the same

    if pins["enable"] is None:
        motor = Motor(pins["forward"], pins["backward"])

        def turn(share: float) -> None:
            motor.value = share

        return turn
    ahead, back = (DigitalOutputDevice(pins[word]) for word in ("forward", "backward"))
    power = PWMOutputDevice(pins["enable"])

    def drive(share: float) -> None:
        power.value = 0.0  # it stands while the way changes
        ahead.value, back.value = share > 0, share < 0
        power.value = abs(share)

    return drive


def make_channel_motor(board: Pca9685, channels: Mapping[str, int | None]) -> MotorSetter:
    """Return a motor on channels of a PCA9685."""
    forward, backward, enable = (channels[word] for word in ("forward", "backward", "enable"))

    def turn(share: float) -> None:
        ahead, back = max(share, 0.0), max(-share, 0.0)
        if enable is not None:
            board.set_duty_cycle(enable, 0.0)  # it stands while the way changes
            ahead, back = float(share > 0), float(share < 0)
        for channel, on in sorted(((forward, ahead), (backward, back)), key=lambda each: each[1]):
            if channel is not None:
                board.set_duty_cycle(channel, on)
        if enable is not None:
            board.set_duty_cycle(enable, abs(share))

    return turn


POLL_INTERVAL = 0.02
"""Seconds between two looks at the time."""

REST_TRIES = 3
"""How often all is let rest at the end."""

EXIT_AFTER = 5.0
"""Seconds of silence after which nobody will come back: somebody else may want the pins."""


def main(config: str) -> int:
    """Hold what ``told`` (JSON) is about, until the standard input ends; return the exit code."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(number, signal.SIG_IGN)
    clock = SystemClock()
    try:
        with notification_folder():
            held = make_actuators(json.loads(config))
        keeper = ActuatorGuardian(held, 1 + int.from_bytes(os.urandom(2)) % 32000, clock.now())
    except Exception as error:
        return print_error(error)
    why: Exception | None = None
    try:
        serve(keeper, clock)
    except Exception as error:
        why = error
    unrested = _rest_actuators(keeper, clock)
    if unrested is not None:
        return print_error(RuntimeError(f"the actuators perhaps do not rest: {type(unrested).__name__}: {unrested}"))
    return 0 if why is None else print_error(why)


@contextmanager
def notification_folder() -> Iterator[None]:
    """Have lgpio write its notification files into a private folder while it is imported.

    Else it takes the current folder, and has no pins where that is read-only. The folder is removed at once: lgpio has
    its file open by then, and a guardian that is killed leaves nothing.
    """
    chosen = os.environ.get("LG_WD")
    try:
        before = Path.cwd()
    except OSError:  # it was removed
        before = Path("/")
    with TemporaryDirectory(prefix="missiontree-lgpio-", ignore_cleanup_errors=True) as own:
        os.environ["LG_WD"] = chosen or own
        os.chdir(chosen or own)
        try:
            yield
        finally:
            os.chdir(before)
            if chosen is None:
                del os.environ["LG_WD"]


def _rest_actuators(guardian: ActuatorGuardian, clock: SystemClock) -> Exception | None:
    """Let all rest, thrice, for one may be lost on the bus; return why it was not possible even once."""
    errors = list[Exception]()
    for _ in range(REST_TRIES):
        try:
            guardian.rest(clock.now())
        except Exception as error:
            errors.append(error)
    return errors[-1] if len(errors) == REST_TRIES else None


def serve(guardian: ActuatorGuardian, clock: SystemClock) -> None:
    """Obey and answer until there is nobody any more. Raises what the hardware raises."""
    os.set_blocking(0, False)
    os.set_blocking(1, False)
    while True:
        ready, _, _ = select.select([0], [], [], POLL_INTERVAL)
        data = b""
        if ready:
            with suppress(BlockingIOError):
                data = os.read(0, 4096)
                if not data:
                    return
        now = clock.now()
        said = guardian.feed(data, now)
        if said:
            with suppress(BlockingIOError):  # nobody reads: it is lost, as on a wire
                os.write(1, said)
        if now - guardian.received_at > EXIT_AFTER:
            return


def print_error(error: Exception) -> int:
    """Say in a line what is the matter."""
    words = " ".join(f"{type(error).__name__}: {error}".split())
    with suppress(OSError):
        os.write(1, f"! {words[:400]}\n".encode())
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
