"""What the EEPROM of a virtual servo sets it to, decoded for what uses it all the time."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

from drivers.servos.models import MODELS, Model
from drivers.servos.register import Coding, Register
from drivers.servos.units import baud_of
from drivers.servos.wire import Fault

# The registers in which a servo tells its state, filled from what a virtual one feels.

_NO_CURRENT: Mapping[int, int] = MappingProxyType({56: 512, 68: 2048})
"""What the current sensors of protocol 1.0 read without current, by their address."""

STALL_CURRENT = 370
"""What an STS reads at its stall torque: 2.4 A."""


class Feeling(NamedTuple):
    """The state of a servo as its sensors feel it, positive where its ticks rise.

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


Told = Callable[[Feeling], int]
"""What a register says of a feeling."""


class Readings:
    """The registers of one model that tell its state."""

    def __init__(self, model: Model) -> None:
        told = _told(model)
        self._rows = [(row, *_span(row), told[row.name]) for row in model.table.registers.values() if row.name in told]

    def tell(self, table: bytearray, feeling: Feeling) -> None:
        """Bring a control table up to date."""
        for row, least, most, told in self._rows:
            table[row.address : row.end] = row.encode(min(max(told(feeling), least), most))


def _told(model: Model) -> dict[str, Told]:
    """What the registers say, by their names."""

    def velocity(feeling: Feeling) -> int:
        return round(feeling.velocity / model.speed_unit)

    def current(feeling: Feeling) -> int:  # protocol 1.0: half its range at full torque
        if model.protocol == "STS":
            return round(STALL_CURRENT * feeling.drive)
        return round(_NO_CURRENT[model.table["present_current"].address] * (1 + feeling.drive / 2))

    return {
        "present_position": lambda feeling: feeling.position,
        "moving": lambda feeling: int(feeling.velocity != 0),
        "moving_status": lambda feeling: int(feeling.arrived),
        "present_voltage": lambda feeling: round(feeling.voltage * 10),
        "present_temperature": lambda feeling: round(feeling.temperature),
        "realtime_tick": lambda feeling: round(feeling.now * 1000) % 32_768,
        "present_pwm": lambda feeling: round(feeling.drive * model.full),
        "velocity_trajectory": velocity,
        "position_trajectory": lambda feeling: feeling.position,
        "present_current": current,
        model.table.velocity: velocity,
        model.table.effort: lambda feeling: round(feeling.drive / model.effort_unit),
    }


def _span(register: Register) -> tuple[int, int]:
    """Return the least and the most that the bytes of ``register`` can say."""
    if register.coding is Coding.SIGN_BIT:
        return -1023, 1023
    if register.coding is Coding.SIGN_15:
        return -32_767, 32_767
    bits = 8 * register.size
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if register.coding is Coding.TWOS else (0, (1 << bits) - 1)


class Mode(Enum):
    """What a goal is to a servo."""

    JOINT = "a position within the limits"
    TURNS = "a position over several turns"
    SPEED = "a speed, endlessly"
    POWER = "a share of the power or current, endlessly"


MODES: Mapping[int, Mode] = MappingProxyType(
    {0: Mode.POWER, 1: Mode.SPEED, 3: Mode.JOINT, 4: Mode.TURNS, 5: Mode.TURNS, 16: Mode.POWER}
)
"""Register ``operating_mode`` of protocol 2.0."""

_REVERSED, _TORQUE_BY_GOAL = 1, 8  # bits of the drive mode


class Settings(NamedTuple):
    """The settings of one servo.

    ``limits`` are the goals (ticks) that it takes as a joint, ``sense`` is -1 where it counts the other way round,
    ``offset`` is what it adds to the ticks that its sensor reads. ``voltages`` bound its supply (0.1 V), ``hottest`` is
    what its motor may reach (degrees Celsius). ``goal_stiffens`` says whether a goal switches its torque on.
    """

    baud: int
    return_delay: int
    mode: Mode
    limits: tuple[int, int]
    sense: int
    offset: int
    goal_stiffens: bool
    voltages: tuple[int, int]
    hottest: int
    shutdown: int


def settings_of(model: Model, table: bytearray) -> Settings:
    """Decode the settings of a servo from its control table."""
    registers = model.table.registers

    def value(name: str) -> int:
        """What a register holds; 0 for one that the model has not."""
        return registers[name].decode(table) if name in registers else 0

    lower, upper = model.table.limits
    limits = value(lower), value(upper)
    old, drive = model.protocol == 1, value("drive_mode")
    sts = model.protocol == "STS"
    return Settings(
        baud=baud_of(value("baud"), model.protocol),
        return_delay=value("return_delay"),
        mode=_old_mode(model, limits)
        if old
        else _sts_mode(value("mode"), limits)
        if sts
        else MODES[value("operating_mode")],
        limits=limits,
        sense=-1 if drive & _REVERSED else 1,
        offset=-value("position_offset") if sts else value("multi_turn_offset" if old else "homing_offset"),
        goal_stiffens=old or sts or bool(drive & _TORQUE_BY_GOAL),
        voltages=(value("lowest_voltage"), value("highest_voltage")),
        hottest=value("temperature_limit"),
        shutdown=value("shutdown"),
    )


def _sts_mode(mode: int, limits: tuple[int, int]) -> Mode:
    """What register ``mode`` of an STS makes of a goal."""
    if mode == 0:
        return Mode.TURNS if limits == (0, 0) else Mode.JOINT
    return {1: Mode.SPEED, 2: Mode.POWER}.get(mode, Mode.TURNS)


def _old_mode(model: Model, limits: tuple[int, int]) -> Mode:
    """What limits of protocol 1.0 make of a goal."""
    if limits == (0, 0):
        return Mode.SPEED if "position_p_gain" in model.table else Mode.POWER  # AX, RX and EX control no speed
    return Mode.TURNS if limits == (model.last, model.last) and "multi_turn_offset" in model.table else Mode.JOINT


# The control table of a virtual servo: what it holds, and what may be written to it from outside.
#
# Where the e-Manual is silent a write is carried out whole or not at all.

# Values that the servo itself bounds by others, beyond the bounds of the registers.
_CEILINGS: Mapping[str, str] = MappingProxyType(
    {"goal_pwm": "pwm_limit", "goal_current": "current_limit", "goal_velocity": "velocity_limit"}
)


FINE = Fault(0)
"""No fault, made ready: flags are slow to make."""

_NEED_CURRENT = (0, 5)
"""Operating modes of servos that measure their current."""


@dataclass(frozen=True, slots=True)
class Span:
    """What a stretch of a table holds: ``rows`` share a byte with it, ``known`` ones fill it, ``whole`` ones fit in.

    ``names`` are those of the rows.
    """

    rows: tuple[Register, ...]
    names: frozenset[str]
    known: bool
    whole: bool


class Memory:
    """The registers of one servo of ``model``. Names are those of its table."""

    def __init__(self, model: str) -> None:
        self.model = MODELS[model]
        self.table = bytearray(self.model.table.size)
        self._rows = self.model.table.registers
        self._spans: dict[tuple[int, int], Span] = {}  # what was looked up before
        self._id_at = self._rows["id"].address
        self._volatile = min(register.address for register in self._rows.values() if not register.eeprom)
        self._kept = bytearray(self._volatile)  # what survives a power cut
        self._decoded: tuple[bytes, Settings] | None = None  # the EEPROM, and what it says
        for register in self._rows.values():
            self.set(register, self.model.default(register))

    def get(self, register: str | Register) -> int:
        """Return what the table holds."""
        return self._row(register).decode(self.table)

    def set(self, register: str | Register, value: int) -> None:
        """Change the table from inside: no access rule holds."""
        row = self._row(register)
        self.table[row.address : row.end] = row.encode(value)
        if row.eeprom:
            self._kept[row.address : row.end] = row.encode(value)

    def has(self, name: str) -> bool:
        """Whether this model has a register called ``name``."""
        return name in self._rows

    @property
    def number(self) -> int:
        """Its ID."""
        return self.table[self._id_at]

    @property
    def settings(self) -> Settings:
        """What its EEPROM sets it to; decoded anew when that has changed."""
        eeprom = bytes(self.table[: self._volatile])
        if self._decoded is None or self._decoded[0] != eeprom:
            self._decoded = eeprom, settings_of(self.model, self.table)
        return self._decoded[1]

    def keep(self) -> None:
        """Let the settings as they are survive a power cut, unless an STS was locked before."""
        if self.model.protocol != "STS" or not self.get("lock"):
            self._kept[:] = self.table[: self._volatile]

    def recall(self) -> None:
        """Take the settings back that survive a power cut."""
        self.table[: self._volatile] = self._kept

    def span(self, address: int, size: int) -> Span:
        """Return what ``size`` bytes from ``address`` on hold."""
        found = self._spans.get((address, size))
        if found is None:
            end = address + size
            rows = tuple(row for row in self._rows.values() if row.address < end and address < row.end)
            inside = sum(min(row.end, end) - max(row.address, address) for row in rows)
            found = Span(
                rows,
                frozenset(row.name for row in rows),
                known=inside == size,
                whole=inside == sum(row.size for row in rows),
            )
            self._spans[address, size] = found
        return found

    def clamped(self, address: int, data: bytes) -> bytes:
        """Return ``data`` with the goal in it, if a joint's goal is in it, brought within the limits."""
        goal = self.model.table[self.model.table.goal]
        if self.settings.mode is not Mode.JOINT or goal.address < address or goal.end > address + len(data):
            return data
        lowest, highest = self.settings.limits
        within = min(max(goal.decode(data, address), lowest), highest)
        start = goal.address - address
        return data[:start] + goal.encode(within) + data[start + goal.size :]

    def refused(self, address: int, data: bytes) -> Fault:
        """Return why it would not take ``data`` at ``address``; no bit when it would."""
        old, span = self.model.protocol == 1, self.span(address, len(data))
        if not data or not (old or span.whole):
            return Fault.RANGE if old else Fault.LENGTH
        if not span.known or not all(row.writable and self._open(row) for row in span.rows):
            return Fault.RANGE if old else Fault.ACCESS
        if not span.whole:  # the rest of its registers stays as it is
            first, last = span.rows[0].address, span.rows[-1].end
            data = bytes(self.table[first:address]) + data + bytes(self.table[address + len(data) : last])
            address = first
        for row in span.rows:
            if reason := self._unfit(row, row.decode(data, address)):
                return reason
        return FINE

    def _open(self, row: Register) -> bool:
        """Whether the EEPROM is open, if ``row`` lies there: not while locked, or under torque (protocol 2.0)."""
        return not row.eeprom or not self.get("lock" if self.has("lock") else "torque_enable")

    def _unfit(self, row: Register, value: int) -> Fault:
        """Return why ``row`` would not take ``value``."""
        if not row.lower <= value <= row.upper or (row.name == "operating_mode" and not self._runs(value)):
            return Fault.RANGE
        if row.name.startswith("goal_") and self.has("bus_watchdog") and self.get("bus_watchdog") < 0:
            return Fault.RANGE  # once the watchdog has fired, until 0 is written to it
        if row.name == "lock" and value < self.get(row):
            return Fault.RANGE  # only cutting the power unlocks it
        if row.name == self.model.table.goal and self.settings.mode is Mode.JOINT:
            lowest, highest = self.settings.limits
            if not lowest <= value <= highest:
                return Fault.ANGLE_LIMIT if self.model.protocol == 1 else Fault.LIMIT
        if row.name in _CEILINGS and abs(value) > self.get(_CEILINGS[row.name]):
            return Fault.LIMIT
        return FINE

    def _runs(self, operating_mode: int) -> bool:
        return operating_mode in MODES and (operating_mode not in _NEED_CURRENT or self.has("current_limit"))

    def _row(self, register: str | Register) -> Register:
        return self._rows[register] if isinstance(register, str) else register
