"""Dynamixel models as data: control tables, and what a tick is worth in SI units.

A model is one row at the end of this file. Registers are little-endian and unsigned; signed figures are a size in bits
0..9 and a direction in bit 10. Positive is anticlockwise, seen facing the horn. Source: ROBOTIS e-Manual, AX series.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, radians
from types import MappingProxyType

RPM = 2 * pi / 60
CLOCKWISE = 0x400
"""The bit that turns a speed or a load clockwise."""

FULL = 1023
"""The largest size of a speed, a load or a torque."""


@dataclass(frozen=True, slots=True)
class Register:
    """One entry of a control table. ``size`` in bytes; ``lower`` and ``upper`` bound what may be written."""

    name: str
    address: int
    size: int
    default: int
    lower: int
    upper: int
    writable: bool = True
    eeprom: bool = False  # survives a power cut; the others start from their defaults

    @property
    def end(self) -> int:
        """The address behind it."""
        return self.address + self.size

    def encode(self, value: int) -> bytes:
        """Return ``value`` as the table holds it. Raises OverflowError if it does not fit."""
        return value.to_bytes(self.size, "little")

    def decode(self, data: bytes | bytearray, start: int = 0) -> int:
        """Return the value from ``data``, a copy of the table that begins at address ``start``."""
        return int.from_bytes(data[self.address - start : self.end - start], "little")


def _eeprom(name: str, address: int, size: int, default: int, lower: int, upper: int) -> Register:
    return Register(name, address, size, default, lower, upper, eeprom=True)


def _present(name: str, address: int, size: int) -> Register:
    return Register(name, address, size, 0, 0, 0, writable=False)


MODEL_NUMBER = Register("model_number", 0, 2, 0, 0, 0, writable=False, eeprom=True)
FIRMWARE = Register("firmware", 2, 1, 24, 0, 0, writable=False, eeprom=True)
ID = _eeprom("id", 3, 1, 1, 0, 253)
BAUD = _eeprom("baud", 4, 1, 1, 0, 254)  # a code: see baud_of
RETURN_DELAY = _eeprom("return_delay", 5, 1, 250, 0, 254)  # 2 µs
CW_ANGLE_LIMIT = _eeprom("cw_angle_limit", 6, 2, 0, 0, 1023)  # ticks; both limits 0: wheel mode
CCW_ANGLE_LIMIT = _eeprom("ccw_angle_limit", 8, 2, 1023, 0, 1023)
TEMPERATURE_LIMIT = _eeprom("temperature_limit", 11, 1, 70, 0, 150)  # degrees Celsius
LOWEST_VOLTAGE = _eeprom("lowest_voltage", 12, 1, 60, 50, 250)  # 0.1 V
HIGHEST_VOLTAGE = _eeprom("highest_voltage", 13, 1, 140, 50, 250)
MAX_TORQUE = _eeprom("max_torque", 14, 2, 1023, 0, 1023)  # copied to TORQUE_LIMIT at power-on
STATUS_RETURN_LEVEL = _eeprom("status_return_level", 16, 1, 2, 0, 2)  # 0 ping, 1 and read, 2 and everything else
ALARM_LED = _eeprom("alarm_led", 17, 1, 36, 0, 127)  # masks of error bits
SHUTDOWN = _eeprom("shutdown", 18, 1, 36, 0, 127)
TORQUE_ENABLE = Register("torque_enable", 24, 1, 0, 0, 1)
LED = Register("led", 25, 1, 0, 0, 1)
CW_MARGIN = Register("cw_compliance_margin", 26, 1, 1, 0, 255)  # ticks
CCW_MARGIN = Register("ccw_compliance_margin", 27, 1, 1, 0, 255)
CW_SLOPE = Register("cw_compliance_slope", 28, 1, 32, 0, 254)
CCW_SLOPE = Register("ccw_compliance_slope", 29, 1, 32, 0, 254)
GOAL_POSITION = Register("goal_position", 30, 2, 0, 0, 1023)  # writing it switches the torque on
MOVING_SPEED = Register("moving_speed", 32, 2, 0, 0, 2047)  # 0: as fast as it can
TORQUE_LIMIT = Register("torque_limit", 34, 2, 1023, 0, 1023)  # 0 after a shutdown
PRESENT_POSITION = _present("present_position", 36, 2)
PRESENT_SPEED = _present("present_speed", 38, 2)
PRESENT_LOAD = _present("present_load", 40, 2)
PRESENT_VOLTAGE = _present("present_voltage", 42, 1)  # 0.1 V
PRESENT_TEMPERATURE = _present("present_temperature", 43, 1)  # degrees Celsius
REGISTERED = _present("registered", 44, 1)
MOVING = _present("moving", 46, 1)
LOCK = Register("lock", 47, 1, 0, 0, 1)  # 1 closes the EEPROM until the power is cut
PUNCH = Register("punch", 48, 2, 32, 0, 1023)

_AX = (
    *(MODEL_NUMBER, FIRMWARE, ID, BAUD, RETURN_DELAY, CW_ANGLE_LIMIT, CCW_ANGLE_LIMIT, TEMPERATURE_LIMIT),
    *(LOWEST_VOLTAGE, HIGHEST_VOLTAGE, MAX_TORQUE, STATUS_RETURN_LEVEL, ALARM_LED, SHUTDOWN),
    *(TORQUE_ENABLE, LED, CW_MARGIN, CCW_MARGIN, CW_SLOPE, CCW_SLOPE, GOAL_POSITION, MOVING_SPEED, TORQUE_LIMIT),
    *(PRESENT_POSITION, PRESENT_SPEED, PRESENT_LOAD, PRESENT_VOLTAGE, PRESENT_TEMPERATURE),
    *(REGISTERED, MOVING, LOCK, PUNCH),
)


@dataclass(frozen=True, slots=True)
class Model:
    """One kind of servo.

    ``tick`` is the angle of one position step and ``speed_unit`` (rad/s) of one speed step; ``centre`` is the tick of
    angle zero, ``last`` the highest one; ``free_speed`` is what the unloaded motor reaches at its nominal voltage.
    ``defaults`` holds those defaults of ``registers`` in which this model differs, by name.
    """

    name: str
    number: int
    registers: tuple[Register, ...]
    tick: float
    centre: int
    last: int
    speed_unit: float
    free_speed: float
    defaults: Mapping[str, int]

    def default(self, register: Register) -> int:
        """Return what ``register`` holds as delivered."""
        return self.defaults.get(register.name, register.default)

    def angle(self, ticks: float) -> float:
        """Return the angle in radians from the centre."""
        return (ticks - self.centre) * self.tick

    def ticks(self, angle: float) -> int:
        """Return the nearest position step to ``angle`` (radians from the centre), within the servo's range."""
        return min(max(round(angle / self.tick) + self.centre, 0), self.last)

    def speed(self, raw: int) -> float:
        """Return a present speed in rad/s."""
        return signed(raw) * self.speed_unit

    def speed_ticks(self, speed: float) -> int:
        """Return ``speed`` (rad/s) for ``MOVING_SPEED``: at least 1, since 0 would mean as fast as it can."""
        return min(max(round(speed / self.speed_unit), 1), FULL)


def signed(raw: int) -> int:
    """Return a size with its direction bit as a number: clockwise is negative."""
    size = raw & FULL
    return -size if raw & CLOCKWISE else size


def unsigned(value: float) -> int:
    """Return ``value`` as a size, cut off at ``FULL``, with its direction bit."""
    size = min(abs(round(value)), FULL)
    return size | CLOCKWISE if value < 0 else size


def baud_of(code: int) -> int:
    """Return the rate that ``BAUD`` stands for: 2 000 000 / (code + 1), with the usual rate where one is meant."""
    return _USUAL.get(code, round(2_000_000 / (code + 1)))


def baud_code(baud: int) -> int:
    """Return the code of the nearest rate that ``BAUD`` can name."""
    return min(max(round(2_000_000 / baud) - 1, BAUD.lower), BAUD.upper)


_USUAL = MappingProxyType({16: 115_200, 34: 57_600, 103: 19_200, 207: 9600})


def _ax(name: str, number: int, *, free_rpm: float, temperature_limit: int, max_torque: int) -> Model:
    """Make a model of the AX family, which share 1024 ticks over 300 degrees and a speed unit of 0.111 rpm."""
    defaults = {
        MODEL_NUMBER.name: number,
        TEMPERATURE_LIMIT.name: temperature_limit,
        MAX_TORQUE.name: max_torque,
        TORQUE_LIMIT.name: max_torque,
    }
    return Model(
        name, number, _AX, radians(300) / 1024, 512, 1023, 0.111 * RPM, free_rpm * RPM, MappingProxyType(defaults)
    )


MODELS: Mapping[str, Model] = MappingProxyType(
    {
        model.name: model
        for model in (
            _ax("AX-12A", 12, free_rpm=59, temperature_limit=70, max_torque=1023),
            _ax("AX-18A", 18, free_rpm=97, temperature_limit=75, max_torque=983),
        )
    }
)
"""The models by name. AX-12 and AX-12+ answer with the number of the AX-12A and are the same to a program."""
