"""What the EEPROM of a virtual servo sets it to, decoded for what uses it all the time."""

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple

from drivers.dynamixel.models import Model
from drivers.dynamixel.units import baud_of


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
