"""What the EEPROM of a virtual servo sets it to, decoded for what uses it all the time."""

from collections.abc import Callable, Mapping
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

from drivers.servos.models import Model
from drivers.servos.register import Coding, Register
from drivers.servos.units import baud_of

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
