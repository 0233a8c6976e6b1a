"""Actuator guardian: a process that holds the pins, and stops the actuators if the driver is silent or dies.

GPIO pins and a PCA9685 have no watchdog: they keep their last output. So a separate process holds them, and receives
the commands on its standard input. The guardian stops motors and lets servos keep their angles after
``WATCHDOG_TIMEOUT`` seconds of silence, and at once when its input ends. The process has a session of its own, and
ignores signals of the terminal. One case is not covered: if the guardian is killed together with the driver (``kill
-9`` of both), or the kernel hangs, the motors keep running.
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

# PCA9685 on an I2C bus: sixteen PWM outputs at 50 Hz.
#
# Source: data sheet of NXP (rev. 4): MODE1 at 0 (sleep is bit 4, auto-increment bit 5, restart bit 7), four registers
# for each channel from 6 on (on and off counts, low byte first, of 4096; bit 4 of a high byte is always on, or always
# off), the prescaler at 254. The chip keeps its outputs while it has power, even if its master dies.

MODE1, MODE2, FIRST_CHANNEL, PRESCALE = 0x00, 0x01, 0x06, 0xFE
SLEEP, INCREMENT, TOTEM_POLE = 0x10, 0x20, 0x04
ALWAYS = 0x10

FREQUENCY = 50.0
"""Pulse frequency of a PCA9685 in hertz, as hobby servos need; all channels share it."""

COUNTS = 4096
PERIOD_US = 1e6 / FREQUENCY

PRESCALE_50_HZ = round(25e6 / (COUNTS * FREQUENCY)) - 1
"""Value of the prescaler register of a PCA9685 for 50 Hz, with its internal oscillator (25 MHz)."""

MIN_PULSE_US, MAX_PULSE_US = 544.0, 2400.0
"""Pulses of 0 and 180 degrees, as in the Arduino's Servo library."""


class I2CBus(Protocol):
    """Methods of ``smbus2.SMBus`` that the guardian uses. They raise OSError if no chip replies."""

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> Sequence[int]:
        """Return ``length`` bytes of a chip from ``register`` on."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> object:
        """Write ``data`` to a chip from ``register`` on."""
        ...


class Pca9685:
    """PCA9685 chip at ``address`` on the I2C bus ``bus``. Channels that are not set here keep their output."""

    def __init__(self, bus: I2CBus, address: int) -> None:
        self._bus, self._address = bus, address
        self._was_running = False  # it keeps the outputs of an earlier program

    def wake(self) -> None:
        """Start the pulses at 50 Hz. If the chip already sends them, its outputs are kept and can be read."""
        (mode,) = self._bus.read_i2c_block_data(self._address, MODE1, 1)
        (scale,) = self._bus.read_i2c_block_data(self._address, PRESCALE, 1)
        self._was_running = bool(not mode & SLEEP and mode & INCREMENT and scale == PRESCALE_50_HZ)
        if self._was_running:
            return
        self._write(MODE1, SLEEP | INCREMENT)  # the prescaler can only be set during sleep
        self._write(PRESCALE, PRESCALE_50_HZ)
        self._write(MODE2, TOTEM_POLE)
        self._write(MODE1, INCREMENT)

    def set_duty_cycle(self, channel: int, share: float) -> None:
        """Set the duty cycle of a channel, 0..1."""
        counts = round(share * COUNTS)
        if counts <= 0:
            self._set_counts(channel, 0, ALWAYS << 8)
        elif counts >= COUNTS:
            self._set_counts(channel, ALWAYS << 8, 0)
        else:
            self._set_counts(channel, 0, counts)

    def set_angle(self, channel: int, degree: int) -> None:
        """Set the servo on a channel to an angle in whole degrees, 0..180."""
        pulse = MIN_PULSE_US + (MAX_PULSE_US - MIN_PULSE_US) * degree / 180
        self._set_counts(channel, 0, round(pulse * COUNTS / PERIOD_US))

    def read_angle(self, channel: int) -> int | None:
        """Return the angle in degrees to which the servo on a channel was last set; None if unknown.

        It is unknown after the chip was switched on, and if the pulse of the channel is not that of a servo.
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


# Actuators of a guardian on a Raspberry Pi: motors on pins, motors and servos on a PCA9685.

MotorSetter = Callable[[float], None]
"""Sets a motor to a share of full power, -1..1."""


def make_actuators(config: Mapping[str, Any]) -> Actuators:
    """Return two motors or two servos for ``config``, the guardian's argument.

    Raises ImportError, OSError and the exceptions of gpiozero.
    """
    if "pan" in config:
        return make_servos(open_pca9685(config), config["pan"], config["tilt"])
    if config["motors"] == "gpio":
        return make_wheels(make_pin_motor(config["left"]), make_pin_motor(config["right"]))
    board = open_pca9685(config)
    return make_wheels(make_channel_motor(board, config["left"]), make_channel_motor(board, config["right"]))


def make_wheels(left: MotorSetter, right: MotorSetter) -> GuardianWheels:
    """Return the two motors of a car, stopped; ``left`` and ``right`` set their power."""

    def turn(one: float, other: float) -> None:
        try:
            left(one)
        finally:  # an error of one must not keep the other running
            right(other)

    return GuardianWheels(turn)


def make_servos(board: Pca9685, pan: int, tilt: int) -> GuardianServos:
    """Return the servos on the channels ``pan`` and ``tilt``, at the angles to which they were last set.

    A servo without a known angle gets no pulse until its first command.
    """
    channels = (pan, tilt)

    def pulse(number: int, degree: int) -> None:
        board.set_angle(channels[number], degree)

    standing = board.read_angle(pan), board.read_angle(tilt)
    for channel, degree in zip(channels, standing, strict=True):
        if degree is None:
            board.set_duty_cycle(channel, 0.0)  # no pulse, so that the angle is unknown to the next guardian as well
    return GuardianServos(pulse, standing)


def open_pca9685(config: Mapping[str, Any]) -> Pca9685:
    """Return the PCA9685 of ``config``, which sends pulses from now on."""
    from smbus2 import SMBus  # noqa: PLC0415 - an optional dependency, of those who have one

    bus: I2CBus = SMBus(config["bus"])
    board = Pca9685(bus, config["address"])
    board.wake()
    return board


def make_pin_motor(pins: Mapping[str, int | None]) -> MotorSetter:
    """Return a function that sets the power of a motor on GPIO pins."""
    from gpiozero import DigitalOutputDevice, Motor, PWMOutputDevice  # noqa: PLC0415 - the same

    if pins["enable"] is None:
        motor = Motor(pins["forward"], pins["backward"])

        def turn(share: float) -> None:
            motor.value = share

        return turn
    ahead, back = (DigitalOutputDevice(pins[word]) for word in ("forward", "backward"))
    power = PWMOutputDevice(pins["enable"])

    def drive(share: float) -> None:
        power.value = 0.0  # stopped while the direction changes
        ahead.value, back.value = share > 0, share < 0
        power.value = abs(share)

    return drive


def make_channel_motor(board: Pca9685, channels: Mapping[str, int | None]) -> MotorSetter:
    """Return a function that sets the power of a motor on channels of a PCA9685."""
    forward, backward, enable = (channels[word] for word in ("forward", "backward", "enable"))

    def turn(share: float) -> None:
        ahead, back = max(share, 0.0), max(-share, 0.0)
        if enable is not None:
            board.set_duty_cycle(enable, 0.0)  # stopped while the direction changes
            ahead, back = float(share > 0), float(share < 0)
        for channel, on in sorted(((forward, ahead), (backward, back)), key=lambda each: each[1]):
            if channel is not None:
                board.set_duty_cycle(channel, on)
        if enable is not None:
            board.set_duty_cycle(enable, abs(share))

    return turn


POLL_INTERVAL = 0.02
"""Maximum seconds between two polls of the watchdog."""

REST_TRIES = 3
"""Number of stop commands that are sent to the actuators before the guardian exits."""

EXIT_AFTER = 5.0
"""Seconds of silence after which the process exits, since another program may need the pins."""


def main(config: str) -> int:
    """Run the guardian of the actuators in ``config`` (JSON) until standard input ends; return the exit code."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE):
        signal.signal(number, signal.SIG_IGN)
    clock = SystemClock()
    try:
        with notification_folder():
            actuators = make_actuators(json.loads(config))
        guardian = ActuatorGuardian(actuators, 1 + int.from_bytes(os.urandom(2)) % 32000, clock.now())
    except Exception as error:
        return print_error(error)
    serve_error: Exception | None = None
    try:
        serve(guardian, clock)
    except Exception as error:
        serve_error = error
    rest_error = _rest_actuators(guardian, clock)
    if rest_error is not None:
        return print_error(RuntimeError(f"the actuators may not be at rest: {type(rest_error).__name__}: {rest_error}"))
    return 0 if serve_error is None else print_error(serve_error)


@contextmanager
def notification_folder() -> Iterator[None]:
    """Let lgpio write its notification files into a private folder while it is imported.

    By default it uses the current folder, and fails if that is read-only. The folder is removed at once: lgpio has its
    file open by then, and a killed guardian leaves nothing behind.
    """
    chosen = os.environ.get("LG_WD")
    try:
        previous = Path.cwd()
    except OSError:  # it was removed
        previous = Path("/")
    with TemporaryDirectory(prefix="missiontree-lgpio-", ignore_cleanup_errors=True) as private:
        os.environ["LG_WD"] = chosen or private
        os.chdir(chosen or private)
        try:
            yield
        finally:
            os.chdir(previous)
            if chosen is None:
                del os.environ["LG_WD"]


def _rest_actuators(guardian: ActuatorGuardian, clock: SystemClock) -> Exception | None:
    """Stop the actuators three times, since one command may be lost on the bus; return the error if all failed."""
    errors = list[Exception]()
    for _ in range(REST_TRIES):
        try:
            guardian.rest(clock.now())
        except Exception as error:
            errors.append(error)
    return errors[-1] if len(errors) == REST_TRIES else None


def serve(guardian: ActuatorGuardian, clock: SystemClock) -> None:
    """Execute the commands from standard input and send replies, until the input ends or is silent for ``EXIT_AFTER``.

    Raises the exceptions of the hardware.
    """
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
        reply = guardian.feed(data, now)
        if reply:
            with suppress(BlockingIOError):  # the pipe is full: the reply is lost, as on a wire
                os.write(1, reply)
        if now - guardian.received_at > EXIT_AFTER:
            return


def print_error(error: Exception) -> int:
    """Print an error as one line for the driver, and return the exit code 1."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    with suppress(OSError):
        os.write(1, f"! {text[:400]}\n".encode())
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
