"""Factories of Dynamixel and Feetech drivers: an arm, or a head that is two joints of an arm."""

from typing import TYPE_CHECKING

from drivers.api import Head, Joints
from drivers.api.driver import DriverContext
from drivers.servos.bus import ServoBus
from drivers.servos.declared import DynamixelKeys, JointKeys, NeckJointKeys, NeckKeys
from drivers.servos.driver import DynamixelJoints
from drivers.servos.joint import JointSpec

if TYPE_CHECKING:
    from drivers.head.joints_head import JointAxis

REPLY_TIMEOUT = 0.005
"""Response timeout: seconds that a servo's reply may be late, beyond its time on the wire."""

VIRTUAL_REPLY_TIMEOUT = 0.1
"""Reply timeout in seconds for virtual servos, whose process also runs perception and the renderer."""


def arm(keys: DynamixelKeys, site: DriverContext) -> DynamixelJoints:
    """Return the driver of an arm of servos."""
    patience = VIRTUAL_REPLY_TIMEOUT if site.is_virtual else REPLY_TIMEOUT
    return DynamixelJoints(
        ServoBus(site.port, site.clock, baud=keys.baud, name=site.part, reply_timeout=patience, framing=keys.framing),
        joint_specs(keys),
        site.clock,
        rate=keys.rate,
        at_rest=keys.at_end,
        away=keys.away,
        report=site.report,
        name=site.part,
    )


def neck(keys: NeckKeys, site: DriverContext) -> Head:
    """Return the driver of a head that is two joints of the arm; it does not open or close the arm."""
    from drivers.head.joints_head import NeckDriver  # noqa: PLC0415 - few heads are joints of an arm

    led: Joints = site.needed_parts["arm"]
    return NeckDriver(
        led,
        site.clock,
        pan=joint_axis(keys.pan),
        tilt=joint_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        report=site.report,
        name=site.part,
    )


def joint_specs(keys: DynamixelKeys) -> dict[str, JointSpec]:
    """Return the joint configurations of an arm, by name."""
    return {name: _joint_spec(joint, keys.offsets.get(name)) for name, joint in keys.servos.items()}


def joint_axis(keys: NeckJointKeys) -> "JointAxis":
    """Return the axis of a head that is a joint of the arm."""
    from drivers.head.joints_head import JointAxis  # noqa: PLC0415 - as above

    return JointAxis(keys.joint, keys.lower, keys.upper, trim=keys.trim)


def _joint_spec(keys: JointKeys, offset: int | None) -> JointSpec:
    return JointSpec(
        keys.id,
        model=keys.model,
        zero=keys.zero,
        direction=-1 if keys.reverse else 1,
        lower=keys.lower,
        upper=keys.upper,
        speed=keys.speed,
        torque_limit=keys.torque,
        offset=offset,
    )
