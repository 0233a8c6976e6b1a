"""From the keys of a robot file to a base that walks."""

from collections.abc import Callable
from typing import Any

from drivers.api import Imu, Joints
from drivers.api.driver import Site
from drivers.base.steered import settings_of
from drivers.dynamixel.commanded import CommandedJoints
from drivers.dynamixel.motor import motor_of
from drivers.legs.balance import Balance
from drivers.legs.body import body_of
from drivers.legs.compensation import Compensation
from drivers.legs.declared import LegsKeys
from drivers.legs.engine import Engine, Felt
from drivers.legs.loop import WalkingBase


def make(keys: LegsKeys, site: Site) -> WalkingBase:
    """Return the driver; the arm whose joints it leads, and the IMU, are opened and closed besides."""
    joints, walks = site.parts["arm"], engine(keys)
    return WalkingBase(
        joints,
        site.clock,
        walks,
        felt=feeling(site.parts.get("imu")),
        # Virtual servos are where they are told to be.
        compensation=None if site.virtual else compensation(walks, joints),
        torques=torques(walks, joints),
        at_fall=keys.at_fall,
        tucked=keys.body.tucked,
        **settings_of(keys, site),
    )


def engine(keys: LegsKeys) -> Engine:
    """Return what walks. Raises BadRequest for strides that the legs cannot make."""
    found = Engine(body_of(keys.body), keys.stride)
    found.balance = Balance(keys.stride, found.walker.manner.com_height)
    return found


def compensation(walks: Engine, joints: Joints) -> Compensation | None:
    """Return what sets the goals of servos ahead; None for joints of which it is not known how soft they are."""
    if not isinstance(joints, CommandedJoints):
        return None
    servos = {name: joints.described[name] for name in walks.body.walking}
    return Compensation(walks.body, {name: motor_of(it.model, it.spec.torque_limit) for name, it in servos.items()})


def torques(walks: Engine, joints: Joints) -> dict[str, float]:
    """Return what the servos of the legs stall at (Nm), for gaits to be checked; nothing where that is not known."""
    if not isinstance(joints, CommandedJoints):
        return {}
    servos = {name: joints.described[name] for name in walks.body.walking}
    return {name: it.model.stall_torque * it.spec.torque_limit for name, it in servos.items()}


def feeling(imu: Any) -> Callable[[], Felt | None]:
    """Return what tells how the trunk leans; it knows nothing without an IMU, or while that is silent."""
    part: Imu | None = imu

    def felt() -> Felt | None:
        reading = None if part is None else part.attitude()
        if reading is None or reading.value is None or not reading.good:
            return None
        found = reading.value
        return Felt(found.roll, found.pitch, found.rates[0], found.rates[1])

    return felt
