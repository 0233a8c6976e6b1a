"""Control table of a virtual servo: decoded settings, simulated readings, and write rules."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

from drivers.servos.models import MODELS, ServoModel
from drivers.servos.register import Coding, Register
from drivers.servos.units import baud_of
from drivers.servos.wire import ServoFault

# The state registers of a servo, filled from the state of the virtual servo.

_NO_CURRENT: Mapping[int, int] = MappingProxyType({56: 512, 68: 2048})
"""Readings of the current registers of protocol 1.0 that mean 0 A, by address."""

STALL_CURRENT_STEPS = 370
"""Current reading of an STS at its stall torque: 2.4 A."""


class SensorValues(NamedTuple):
    """Sensor values of a servo, positive in the direction of rising ticks.

    ``position`` in ticks, ``velocity`` in rad/s, ``drive`` as a share of the stall torque, ``voltage`` in volts,
    ``temperature`` in degrees Celsius, ``now`` in seconds.
    """

    position: int
    velocity: float
    drive: float
    arrived: bool
    voltage: float
    temperature: float
    now: float


RegisterReading = Callable[[SensorValues], int]
"""Function from sensor values to the value of a register."""


class StateRegisters:
    """Registers of one servo model that hold its readings."""

    def __init__(self, model: ServoModel) -> None:
        told = _register_readings(model)
        self._rows = [
            (row, *_value_range(row), told[row.name]) for row in model.table.registers.values() if row.name in told
        ]

    def update(self, table: bytearray, values: SensorValues) -> None:
        """Update the readings in a control table."""
        for row, least, most, told in self._rows:
            table[row.address : row.end] = row.encode(min(max(told(values), least), most))


def _register_readings(model: ServoModel) -> dict[str, RegisterReading]:
    """Return the reading functions by register name."""

    def velocity(feeling: SensorValues) -> int:
        return round(feeling.velocity / model.speed_unit)

    def current(feeling: SensorValues) -> int:  # protocol 1.0: half its range at full torque
        if model.protocol == "STS":
            return round(STALL_CURRENT_STEPS * feeling.drive)
        return round(_NO_CURRENT[model.table["present_current"].address] * (1 + feeling.drive / 2))

    return {
        "present_position": lambda feeling: feeling.position,
        "moving": lambda feeling: int(feeling.velocity != 0),
        "moving_status": lambda feeling: int(feeling.arrived),
        "present_voltage": lambda feeling: round(feeling.voltage * 10),
        "present_temperature": lambda feeling: round(feeling.temperature),
        "realtime_tick": lambda feeling: round(feeling.now * 1000) % 32_768,
        "present_pwm": lambda feeling: round(feeling.drive * model.full_torque),
        "velocity_trajectory": velocity,
        "position_trajectory": lambda feeling: feeling.position,
        "present_current": current,
        model.table.velocity: velocity,
        model.table.effort: lambda feeling: round(feeling.drive / model.effort_unit),
    }


def _value_range(register: Register) -> tuple[int, int]:
    """Return the lowest and highest value that the bytes of ``register`` can hold."""
    if register.coding is Coding.SIGN_10:
        return -1023, 1023
    if register.coding is Coding.SIGN_15:
        return -32_767, 32_767
    bits = 8 * register.size
    return (
        (-(1 << bits - 1), (1 << bits - 1) - 1) if register.coding is Coding.TWOS_COMPLEMENT else (0, (1 << bits) - 1)
    )


class ServoMode(Enum):
    """Operating mode of a servo: the meaning of its goal."""

    JOINT = "a position within the limits"
    MULTI_TURN = "a position over several turns"
    SPEED = "a speed, endlessly"
    POWER = "a share of the power or current, endlessly"


MODES: Mapping[int, ServoMode] = MappingProxyType(
    {
        0: ServoMode.POWER,
        1: ServoMode.SPEED,
        3: ServoMode.JOINT,
        4: ServoMode.MULTI_TURN,
        5: ServoMode.MULTI_TURN,
        16: ServoMode.POWER,
    }
)
"""Modes by register ``operating_mode`` of protocol 2.0."""

_REVERSED, _TORQUE_BY_GOAL = 1, 8  # bits of the drive mode


class EepromSettings(NamedTuple):
    """Decoded settings of one servo.

    ``limits`` are the lowest and highest allowed goal (ticks) of a joint; ``direction`` is -1 if the servo counts
    positions the other way round; ``offset`` is added to the sensor's ticks. ``voltage_limits`` are in 0.1 V,
    ``max_temperature`` in degrees Celsius. ``goal_enables_torque`` is True if a new goal also switches the torque on.
    """

    baud: int
    return_delay: int
    mode: ServoMode
    limits: tuple[int, int]
    direction: int
    offset: int
    goal_enables_torque: bool
    voltage_limits: tuple[int, int]
    max_temperature: int
    shutdown: int


def decode_settings(model: ServoModel, table: bytearray) -> EepromSettings:
    """Decode the settings of a servo from its control table."""
    registers = model.table.registers

    def value(name: str) -> int:
        """Return the value of a register; 0 if the model lacks it."""
        return registers[name].decode(table) if name in registers else 0

    lower, upper = model.table.limit_registers
    limits = value(lower), value(upper)
    old, drive = model.protocol == 1, value("drive_mode")
    sts = model.protocol == "STS"
    return EepromSettings(
        baud=baud_of(value("baud"), model.protocol),
        return_delay=value("return_delay"),
        mode=_protocol1_mode(model, limits)
        if old
        else _sts_mode(value("mode"), limits)
        if sts
        else MODES[value("operating_mode")],
        limits=limits,
        direction=-1 if drive & _REVERSED else 1,
        offset=-value("position_offset") if sts else value("multi_turn_offset" if old else "homing_offset"),
        goal_enables_torque=old or sts or bool(drive & _TORQUE_BY_GOAL),
        voltage_limits=(value("lowest_voltage"), value("highest_voltage")),
        max_temperature=value("temperature_limit"),
        shutdown=value("shutdown"),
    )


def _sts_mode(mode: int, limits: tuple[int, int]) -> ServoMode:
    """Return the mode of an STS from register ``mode`` and its limits."""
    if mode == 0:
        return ServoMode.MULTI_TURN if limits == (0, 0) else ServoMode.JOINT
    return {1: ServoMode.SPEED, 2: ServoMode.POWER}.get(mode, ServoMode.MULTI_TURN)


def _protocol1_mode(model: ServoModel, limits: tuple[int, int]) -> ServoMode:
    """Return the mode of protocol 1.0 from its limits."""
    if limits == (0, 0):
        # AX, RX and EX have no speed control.
        return ServoMode.SPEED if "position_p_gain" in model.table else ServoMode.POWER
    return (
        ServoMode.MULTI_TURN
        if limits == (model.last_tick, model.last_tick) and "multi_turn_offset" in model.table
        else ServoMode.JOINT
    )


# The control table of a virtual servo, and the checks of writes to it.
#
# Where the e-Manual says nothing, a write is done completely or not at all.

# Registers that the servo limits by other registers, besides their own bounds.
_CEILINGS: Mapping[str, str] = MappingProxyType(
    {"goal_pwm": "pwm_limit", "goal_current": "current_limit", "goal_velocity": "velocity_limit"}
)


NO_FAULT = ServoFault(0)
"""No fault, created once because flags are slow to create."""

_CURRENT_MODES = (0, 5)
"""Operating modes that need a current sensor."""


@dataclass(frozen=True, slots=True)
class TableSpan:
    """Registers that overlap a span of bytes of a control table: ``rows``, and their ``names``.

    ``is_mapped``: the registers cover all bytes of the span; ``is_aligned``: no register extends beyond the span.
    """

    rows: tuple[Register, ...]
    names: frozenset[str]
    is_mapped: bool
    is_aligned: bool


class VirtualTable:
    """Control table of one servo of ``model``, by register name."""

    def __init__(self, model: str) -> None:
        self.model = MODELS[model]
        self.table = bytearray(self.model.table.size)
        self._rows = self.model.table.registers
        self._spans: dict[tuple[int, int], TableSpan] = {}  # cache
        self._id_at = self._rows["id"].address
        self._volatile = min(register.address for register in self._rows.values() if not register.eeprom)
        self._saved_eeprom = bytearray(self._volatile)  # kept without power
        self._decoded: tuple[bytes, EepromSettings] | None = None  # the EEPROM's bytes, and their values
        for register in self._rows.values():
            self.set(register, self.model.default(register))

    def get(self, register: str | Register) -> int:
        """Return the value of a register."""
        return self._row(register).decode(self.table)

    def set(self, register: str | Register, value: int) -> None:
        """Set a register as the servo itself does, without the checks of a write from the bus."""
        row = self._row(register)
        self.table[row.address : row.end] = row.encode(value)
        if row.eeprom:
            self._saved_eeprom[row.address : row.end] = row.encode(value)

    def has(self, name: str) -> bool:
        """True if this model has a register ``name``."""
        return name in self._rows

    @property
    def number(self) -> int:
        """The servo's ID."""
        return self.table[self._id_at]

    @property
    def settings(self) -> EepromSettings:
        """Decoded EEPROM settings; cached until the EEPROM changes."""
        eeprom = bytes(self.table[: self._volatile])
        if self._decoded is None or self._decoded[0] != eeprom:
            self._decoded = eeprom, decode_settings(self.model, self.table)
        return self._decoded[1]

    def save_eeprom(self) -> None:
        """Save the current settings for the next power cycle, unless the EEPROM of an STS is locked."""
        if self.model.protocol != "STS" or not self.get("lock"):
            self._saved_eeprom[:] = self.table[: self._volatile]

    def restore_eeprom(self) -> None:
        """Restore the settings that survive a power cut."""
        self.table[: self._volatile] = self._saved_eeprom

    def span(self, address: int, size: int) -> TableSpan:
        """Return the registers in ``size`` bytes from ``address`` on."""
        found = self._spans.get((address, size))
        if found is None:
            end = address + size
            rows = tuple(row for row in self._rows.values() if row.address < end and address < row.end)
            inside = sum(min(row.end, end) - max(row.address, address) for row in rows)
            found = TableSpan(
                rows,
                frozenset(row.name for row in rows),
                is_mapped=inside == size,
                is_aligned=inside == sum(row.size for row in rows),
            )
            self._spans[address, size] = found
        return found

    def clamp_goal(self, address: int, data: bytes) -> bytes:
        """Return ``data`` with the goal of a joint, if it contains one, clamped to the limits."""
        goal = self.model.table[self.model.table.goal]
        if self.settings.mode is not ServoMode.JOINT or goal.address < address or goal.end > address + len(data):
            return data
        lowest, highest = self.settings.limits
        within = min(max(goal.decode(data, address), lowest), highest)
        start = goal.address - address
        return data[:start] + goal.encode(within) + data[start + goal.size :]

    def refusal(self, address: int, data: bytes) -> ServoFault:
        """Return the fault for which a write is refused; no fault if it is accepted."""
        old, span = self.model.protocol == 1, self.span(address, len(data))
        if not data or not (old or span.is_aligned):
            return ServoFault.RANGE if old else ServoFault.LENGTH
        if not span.is_mapped or not all(row.writable and self._is_unlocked(row) for row in span.rows):
            return ServoFault.RANGE if old else ServoFault.ACCESS
        if not span.is_aligned:  # its other registers are unchanged
            first, last = span.rows[0].address, span.rows[-1].end
            data = bytes(self.table[first:address]) + data + bytes(self.table[address + len(data) : last])
            address = first
        for row in span.rows:
            if reason := self._value_fault(row, row.decode(data, address)):
                return reason
        return NO_FAULT

    def _is_unlocked(self, row: Register) -> bool:
        """True if ``row`` may be written: the EEPROM is locked by ``lock``, or by torque in protocol 2.0."""
        return not row.eeprom or not self.get("lock" if self.has("lock") else "torque_enable")

    def _value_fault(self, row: Register, value: int) -> ServoFault:
        """Return the fault for which ``row`` refuses ``value``."""
        if not row.lower <= value <= row.upper or (row.name == "operating_mode" and not self._supports_mode(value)):
            return ServoFault.RANGE
        if row.name.startswith("goal_") and self.has("bus_watchdog") and self.get("bus_watchdog") < 0:
            return ServoFault.RANGE  # goals are locked after the watchdog fired, until 0 is written to it
        if row.name == "lock" and value < self.get(row):
            return ServoFault.RANGE  # only cutting the power unlocks it
        if row.name == self.model.table.goal and self.settings.mode is ServoMode.JOINT:
            lowest, highest = self.settings.limits
            if not lowest <= value <= highest:
                return ServoFault.ANGLE_LIMIT if self.model.protocol == 1 else ServoFault.LIMIT
        if row.name in _CEILINGS and abs(value) > self.get(_CEILINGS[row.name]):
            return ServoFault.LIMIT
        return NO_FAULT

    def _supports_mode(self, operating_mode: int) -> bool:
        return operating_mode in MODES and (operating_mode not in _CURRENT_MODES or self.has("current_limit"))

    def _row(self, register: str | Register) -> Register:
        return self._rows[register] if isinstance(register, str) else register
