"""Dynamixel and Feetech models as data: control table, and steps in SI units.

A model is one row at the end of this file. Positive is anticlockwise, seen facing the horn, unless the maker defines it
otherwise. Source: ROBOTIS e-Manual, Feetech's data sheets.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from math import radians
from types import MappingProxyType
from typing import Literal

from drivers.api.fast_dataclass import dataclass
from drivers.servos.names_sts import NAMES, SCS_NAMES
from drivers.servos.register import ControlTable, Register
from drivers.servos.tables import (
    TABLE_AX,
    TABLE_EX,
    TABLE_MX,
    TABLE_MX2,
    TABLE_MX2_64,
    TABLE_MX2_106,
    TABLE_MX_CURRENT,
    TABLE_MX_PAIR,
    TABLE_X,
    TABLE_X540,
    TABLE_X_CURRENT,
)
from drivers.servos.tables_small import TABLE_XC330_M, TABLE_XC330_T, TABLE_XL320, TABLE_XL330
from drivers.servos.tables_sts import TABLE_SCS, TABLE_STS
from drivers.servos.units import RPM, Protocol

ReadMode = Literal["single", "bulk", "sync"]
"""Fastest way to read several servos of a model: one by one, by one bulk read, or by one sync read."""

Wiring = Literal["TTL", "RS-485", "either"]


@dataclass(frozen=True, slots=True)
class ServoModel:
    """Model of a Dynamixel or Feetech servo.

    ``tick`` is the angle of a position step and ``speed_unit`` (rad/s) that of a speed step; ``centre_tick`` is the
    position of angle zero, ``last_tick`` the highest one. ``full_torque`` and ``max_speed_ticks`` are the maxima in
    steps of their registers; ``effort_unit`` is a step of load or current as a share of the stall torque.
    ``free_speed`` (rad/s) is the no-load speed and ``stall_torque`` is in Nm, both at ``nominal_voltage``. ``defaults``
    holds the defaults that differ from ``table``, by name. A model that is not ``is_driven`` is recognised, and its
    registers can be read and set; its motor data are unknown.
    """

    name: str
    number: int
    protocol: Protocol
    table: ControlTable
    read_mode: ReadMode
    tick: float
    centre_tick: int
    last_tick: int
    speed_unit: float
    free_speed: float
    stall_torque: float
    full_torque: int
    max_speed_ticks: int
    effort_unit: float
    wiring: Wiring
    nominal_voltage: float
    defaults: Mapping[str, int]
    is_driven: bool = True

    @property
    def top_speed(self) -> float:
        """Highest speed that can be commanded, in rad/s."""
        return self.max_speed_ticks * self.speed_unit

    @property
    def robot_file_hint(self) -> str:
        """Hint to the user if a servo of this model has answered, but the robot file names another model."""
        return (
            f"write model: {self.name}" if self.is_driven else f"take another servo: an {self.name} is not driven here"
        )

    def default(self, register: Register) -> int:
        """Return the factory default of ``register``."""
        return self.defaults.get(register.name, register.default)

    def angle(self, ticks: float) -> float:
        """Return the angle in radians from the centre."""
        return (ticks - self.centre_tick) * self.tick

    def ticks(self, angle: float) -> int:
        """Return the nearest position step to ``angle`` (radians from the centre), within the servo's range."""
        return min(max(round(angle / self.tick) + self.centre_tick, 0), self.last_tick)

    def speed(self, raw: int) -> float:
        """Return a speed reading in rad/s."""
        return raw * self.speed_unit

    def speed_ticks(self, speed: float) -> int:
        """Return ``speed`` (rad/s) in steps: at least 1, since 0 means full speed."""
        return min(max(round(speed / self.speed_unit), 1), self.max_speed_ticks)

    def load(self, raw: int) -> float:
        """Return a load or current reading as a share of the stall torque, positive anticlockwise."""
        return raw * self.effort_unit

    def torque_ticks(self, share: float) -> int:
        """Return a share of the stall torque as a value for the register of the torque limit.

        It is at least 1: a servo of protocol 1.0 that shuts down sets its limit to 0, so 0 would look like a shutdown.
        """
        return min(max(round(share * self.full_torque), 1), self.full_torque)

    def goal_write(self, goal: int, speed: int) -> tuple[int, bytes]:
        """Return address and bytes of the single write that moves to ``goal`` (ticks) at ``speed`` (steps)."""
        place, pace = self.table[self.table.goal], self.table[self.table.speed]
        if place.address < pace.address:  # between them: the duration of a move, 0 because the speed is given
            return place.address, place.encode(goal).ljust(pace.address - place.address, b"\0") + pace.encode(speed)
        return pace.address, pace.encode(speed) + place.encode(goal)


def find_model(number: int) -> ServoModel | None:
    """Return the model with this model number, driven or only recognised; None if unknown."""
    return _by_number().get(number)


@dataclass(frozen=True, slots=True)
class _Family:
    """Common data of a servo family: ``degrees`` of its range, divided into ``ticks``, and ``rpm``.

    ``rpm`` is the value of one step of speed, in turns per minute.
    """

    protocol: Protocol
    read_mode: ReadMode
    degrees: float
    ticks: int
    rpm: float
    load_unit: float  # a share of the stall torque


_AX = _Family(1, "single", 300, 1024, 0.111, 1 / 1023)  # and RX
_EX = _Family(1, "single", 250.92, 4096, 0.111, 1 / 1023)
_MX = _Family(1, "bulk", 360, 4096, 0.114, 1 / 1023)
_X = _Family(2, "sync", 360, 4096, 0.229, 1 / 1000)  # and MX with the firmware of protocol 2.0
_XL320 = _Family(2, "single", 300, 1024, 0.111, 1 / 1023)
_STS = _Family("STS", "sync", 360, 4096, 60 / 4096, 1 / 1000)
_SCS = _Family("STS", "single", 300, 1024, 60 / 1024, 1 / 1000)  # frames of the STS, without the sync read


def _model(
    family: _Family,
    name: str,
    number: int,
    table: ControlTable,
    bus: Wiring,
    stall_torque: float,
    free_rpm: float,
    defaults: Mapping[str, int],
    current: tuple[float, float] | None = None,
    volts: float = 12.0,
) -> ServoModel:
    """Return a model: torque in Nm, speed in rpm, and factory defaults by register name.

    ``current`` is for a servo that reports its current instead of a load: one step of it, and the stall current (A).
    """
    delivered = {"model_number": number, **defaults}
    return ServoModel(
        name=name,
        number=number,
        protocol=family.protocol,
        table=table,
        read_mode=family.read_mode,
        tick=radians(family.degrees) / family.ticks,
        centre_tick=family.ticks // 2,
        last_tick=family.ticks - 1,
        speed_unit=family.rpm * RPM,
        free_speed=free_rpm * RPM,
        stall_torque=stall_torque,
        full_torque=table[table.torque_ceiling].upper,
        max_speed_ticks=delivered.get("velocity_limit", table[table.speed].upper),
        effort_unit=current[0] / current[1] if current else family.load_unit,
        wiring=bus,
        nominal_voltage=volts,
        defaults=MappingProxyType(delivered),
    )


_WHEEL = {"cw_compliance_margin": 4, "ccw_compliance_margin": 4, "cw_compliance_slope": 64, "ccw_compliance_slope": 64}
_WEAKER = {"max_torque": 983, "torque_limit": 983}
_RX = {"baud": 34, "highest_voltage": 190}
_XL = {"temperature_limit": 72, "highest_voltage": 140, "lowest_voltage": 60, "velocity_limit": 265} | {
    "velocity_i_gain": 1000,
    "position_d_gain": 4000,
    "position_p_gain": 640,
}
_XM = {"position_p_gain": 800}
_FAST_XL330 = {"velocity_limit": 1620, "velocity_i_gain": 400, "velocity_p_gain": 40, "position_i_gain": 400}
_AMPS = (0.00269, 2.3)  # of the XM430: one step of its current, and its stall current
_AMPS_540 = (0.00269, 4.4)
_SMALL = (0.001, 1.47)  # of the XL330 at 5 V
_SMALL_M = (0.001, 1.8)  # of the XC330-M at 5 V
_SMALL_T = (0.001, 0.88)  # of the XC330-T at 12 V
_XC = {"moving_threshold": 20, "lowest_voltage": 60, "position_p_gain": 460}
_XC_M = {"position_d_gain": 500, "velocity_i_gain": 1600}
_XC_M181 = {**_XC_M, "velocity_limit": 545, "velocity_i_gain": 1400, "velocity_p_gain": 100, "position_p_gain": 1200}
_XC_M288 = {**_XC_M, "velocity_limit": 350, "velocity_p_gain": 50, "position_p_gain": 1100}
_XC_T = {"position_p_gain": 900, "velocity_i_gain": 1200, "velocity_p_gain": 40}

MODELS: Mapping[str, ServoModel] = MappingProxyType(
    {
        model.name: model
        for model in (
            # family, name, number, control table, wiring, Nm, rpm, changes to the table's defaults, current
            _model(_AX, "AX-12A", 12, TABLE_AX, "TTL", 1.5, 59, {"temperature_limit": 70}),
            _model(_AX, "AX-12W", 300, TABLE_AX, "TTL", 0.2, 54, {"temperature_limit": 70, **_WHEEL}),
            _model(_AX, "AX-18A", 18, TABLE_AX, "TTL", 1.8, 97, {"temperature_limit": 75, **_WEAKER}),
            _model(_AX, "RX-24F", 24, TABLE_AX, "RS-485", 2.6, 126, _RX),
            _model(_AX, "RX-28", 28, TABLE_AX, "RS-485", 3.7, 85, _RX),
            _model(_AX, "RX-64", 64, TABLE_AX, "RS-485", 5.3, 64, _RX),
            _model(_EX, "EX-106+", 107, TABLE_EX, "RS-485", 10.9, 91, {"baud": 34, "highest_voltage": 240}),
            _model(_MX, "MX-28", 29, TABLE_MX, "either", 2.5, 55, {"highest_voltage": 160}),
            _model(_MX, "MX-64", 310, TABLE_MX_CURRENT, "either", 6.0, 63, {"highest_voltage": 240}),
            _model(_MX, "MX-106", 320, TABLE_MX_PAIR, "either", 8.4, 45, {"highest_voltage": 160}),
            _model(_X, "MX-28(2.0)", 30, TABLE_MX2, "either", 2.5, 55, {"velocity_limit": 380}),
            _model(_X, "MX-64(2.0)", 311, TABLE_MX2_64, "either", 6.0, 63, {"velocity_limit": 435}, (0.00336, 4.1)),
            _model(_X, "MX-106(2.0)", 321, TABLE_MX2_106, "either", 8.4, 45, {"velocity_limit": 360}, (0.00336, 5.2)),
            _model(_X, "XL430-W250", 1060, TABLE_X, "TTL", 1.5, 61, _XL),
            _model(_X, "XM430-W210", 1030, TABLE_X_CURRENT, "either", 3.0, 77, {"velocity_limit": 330, **_XM}, _AMPS),
            _model(_X, "XM430-W350", 1020, TABLE_X_CURRENT, "either", 4.1, 46, {"velocity_limit": 200, **_XM}, _AMPS),
            _model(_X, "XL330-M077", 1190, TABLE_XL330, "TTL", 0.215, 383, _FAST_XL330, _SMALL, 5.0),
            _model(_X, "XL330-M288", 1200, TABLE_XL330, "TTL", 0.52, 103, {"velocity_limit": 445}, _SMALL, 5.0),
            _model(_X, "2XL430-W250", 1090, TABLE_X, "TTL", 1.5, 61, {**_XL, "velocity_limit": 250}),
            _model(_X, "XC430-W150", 1070, TABLE_X, "TTL", 1.6, 106, {"velocity_limit": 460, **_XC}),
            _model(_X, "XC430-W240", 1080, TABLE_X, "TTL", 1.9, 70, {"velocity_limit": 306, **_XC}),
            _model(_X, "XM540-W150", 1130, TABLE_X540, "either", 7.3, 53, {"velocity_limit": 230, **_XM}, _AMPS_540),
            _model(_X, "XM540-W270", 1120, TABLE_X540, "either", 10.6, 30, {"velocity_limit": 128, **_XM}, _AMPS_540),
            _model(_X, "XC330-T181", 1210, TABLE_XC330_T, "TTL", 0.8, 113, {"velocity_limit": 510, **_XC_T}, _SMALL_T),
            _model(_X, "XC330-T288", 1220, TABLE_XC330_T, "TTL", 1.0, 71, {"velocity_limit": 320, **_XC_T}, _SMALL_T),
            _model(_X, "XC330-M181", 1230, TABLE_XC330_M, "TTL", 0.6, 129, _XC_M181, _SMALL_M, 5.0),
            _model(_X, "XC330-M288", 1240, TABLE_XC330_M, "TTL", 0.93, 81, _XC_M288, _SMALL_M, 5.0),
            # With other gears, which the servo does not report: SO-101 leaders have three kinds.
            _model(_STS, "STS3215", 777, TABLE_STS, "TTL", 1.91, 52, {}, volts=7.4),
            _model(_STS, "STS3250", 2825, TABLE_STS, "TTL", 4.9, 75, {"highest_voltage": 140}),
        )
    }
)
"""The supported models, by name.

AX-12 and AX-12+ have the number of the AX-12A and are the same to a program. MX servos exist with two firmwares, with
different numbers: ``MX-28`` and ``MX-28(2.0)`` are one servo.
"""


_OTHER_X = (
    *((TABLE_X540, name, number) for name, number in {
        "XH540-W150": 1110, "XH540-W270": 1100, "XH540-V150": 1150, "XH540-V270": 1140,
        "XW540-T140": 1180, "XW540-T260": 1170, "XW540-H260": 1310, "XD540-T150": 1111, "XD540-T270": 1101,
    }.items()),
    *((TABLE_X_CURRENT, name, number) for name, number in {
        "XH430-W210": 1010, "XH430-W350": 1000, "XH430-V210": 1050, "XH430-V350": 1040,
        "XW430-T200": 1280, "XW430-T333": 1270, "XD430-T210": 1011, "XD430-T350": 1001,
    }.items()),
    (TABLE_X, "2XC430-W250", 1160),
)  # fmt: skip


def _recognised_models() -> Iterator[ServoModel]:
    """Yield the models that are recognised, but not driven."""
    yield _variant(_model(_XL320, "XL-320", 350, TABLE_XL320, "TTL", 0.39, 114, {}, volts=7.4), "XL-320", 350)
    yield _variant(MODELS["RX-28"], "RX-10", 10)
    yield _variant(MODELS["MX-28"], "MX-12W", 360)
    yield _variant(MODELS["XC330-T288"], "XC335-T332", 1700)
    for table, name, number in _OTHER_X:
        yield _variant(_model(_X, name, number, table, "either", 1.0, 30, {}), name, number)
    for number, name in NAMES.items():
        if number not in (model.number for model in MODELS.values()):
            yield _variant(MODELS["STS3215"], name, number)
    scs = _model(_SCS, "", 0, TABLE_SCS, "TTL", 0.23, 100, {}, volts=6.0)
    yield from (_variant(scs, name, number) for number, name in SCS_NAMES.items())


def _variant(base: ServoModel, name: str, number: int) -> ServoModel:
    defaults = MappingProxyType({**base.defaults, "model_number": number})
    return replace(base, name=name, number=number, defaults=defaults, is_driven=False)


@cache
def _by_number() -> Mapping[int, ServoModel]:
    return {model.number: model for model in (*_recognised_models(), *MODELS.values())}


# Mechanics of a servo, by its control table and data sheet: stiffness, torque, speed. SI units.

BACKLASH = radians(0.25)
"""Backlash of a servo's output in radians: 15 arc minutes, as ROBOTIS specifies for most models."""

INERTIA_SHARE = 0.011
"""Rotor inertia behind the gears, in kg m2 per Nm of stall torque.

Measured at an XM430-W350: 0.045 kg m2 with 4.1 Nm.
"""

FRICTION_SHARE = 0.0073
"""Dry friction of the gears as a share of the stall torque.

Measured at an XM430-W350: 0.03 Nm of 4.1 Nm.
"""


@dataclass(frozen=True, slots=True)
class MotorPhysics:
    """Physical model of a servo: torque (Nm) = ``stiffness`` times the angle error, up to ``torque``.

    ``damping`` (Nm s) reduces it with the speed, so that the no-load speed is ``torque / damping``. ``inertia`` (kg m2)
    is that of the rotor behind the gears, ``friction`` (Nm) is dry, ``backlash`` is in radians.
    """

    stiffness: float
    damping: float
    torque: float
    inertia: float
    friction: float
    backlash: float = BACKLASH


def motor_physics(model: ServoModel, torque_limit: float = 1.0) -> MotorPhysics:
    """Return the physical model of a servo with its factory gain; ``torque_limit`` is a share of the stall torque.

    AX, RX and EX servos reach full torque at an error of ``cw_compliance_slope`` steps. The torque of MX and X servos
    grows with the error by their proportional gain. The makers do not specify inertia and friction; both are scaled
    from a measured servo.
    """
    stall = model.stall_torque
    return MotorPhysics(
        stiffness=stall * _torque_share_per_step(model) / model.tick,
        damping=stall / model.free_speed,
        torque=stall * torque_limit,
        inertia=INERTIA_SHARE * stall,
        friction=FRICTION_SHARE * stall,
    )


def _torque_share_per_step(model: ServoModel) -> float:
    """Return the share of its torque that a servo applies per step of error."""
    table = model.table
    if "cw_compliance_slope" in table:
        return 1 / model.default(table["cw_compliance_slope"])
    gain = model.default(table["position_p_gain"])
    return gain / 128 / 885 if model.protocol == 2 else gain / 8 / 1023
