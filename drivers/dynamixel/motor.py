"""What a servo is to mechanics: how stiff, how strong, how fast, by its control table and data sheet. SI units."""

from math import radians

from drivers.api.quick import dataclass
from drivers.dynamixel.models import Model

BACKLASH = radians(0.25)
"""Radians that a servo's output turns freely: 15 arc minutes, as ROBOTIS says of most of them."""

INERTIA_SHARE = 0.011
"""Inertia of a rotor behind its gears, in kg m2 for each Nm of stall torque: 0.045 of an XM430-W350 with 4.1 Nm."""

FRICTION_SHARE = 0.0073
"""Dry friction of the gears as a share of the stall torque: 0.03 Nm of the same servo."""


@dataclass(frozen=True, slots=True)
class Motor:
    """A servo: a torque (Nm) that grows by ``stiffness`` with the error of its angle, up to ``torque``.

    It falls by ``damping`` (Nm s) with its speed, so that the motor turns at ``torque / damping`` without a burden.
    ``inertia`` (kg m2) is that of its rotor behind the gears, ``friction`` (Nm) is dry, ``backlash`` in radians.
    """

    stiffness: float
    damping: float
    torque: float
    inertia: float
    friction: float
    backlash: float = BACKLASH


def motor_of(model: Model, torque_limit: float = 1.0) -> Motor:
    """Return what a model of servo is to physics, with the gain that it has as delivered.

    AX, RX and EX give all their torque at an error of ``compliance_slope`` steps; MX and X by their proportional gain.
    Rotor and gears, which no maker tells, are scaled from a servo that was measured.
    """
    stall = model.stall_torque
    return Motor(
        stiffness=stall * _gain(model) / model.tick,
        damping=stall / model.free_speed,
        torque=stall * torque_limit,
        inertia=INERTIA_SHARE * stall,
        friction=FRICTION_SHARE * stall,
    )


def _gain(model: Model) -> float:
    """Return the share of its torque that a servo gives for one step of error."""
    table = model.table
    if "cw_compliance_slope" in table:
        return 1 / model.default(table["cw_compliance_slope"])
    gain = model.default(table["position_p_gain"])
    return gain / 128 / 885 if model.protocol == 2 else gain / 8 / 1023
