"""How a servo joins the robot: it is identified, then its volatile settings are restored; never its EEPROM."""

from drivers.dynamixel import models as m
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.torque import stiffen


def difference(bus: Bus, joint: Joint) -> str:
    """Return in what the servo is not what the robot file says; empty when it may be driven.

    Raises NoReply, NotConnected.
    """
    number = bus.ping(joint.spec.id, tries=1 if joint.failures else 3)
    if number != joint.model.number:
        known = next((model.name for model in m.MODELS.values() if model.number == number), "unknown")
        return f"is model {number} ({known}), not {joint.model.number} ({joint.model.name})"
    table = bus.read_block(joint.spec.id, 0, m.STATUS_RETURN_LEVEL.end)
    low, high = m.CW_ANGLE_LIMIT.decode(table), m.CCW_ANGLE_LIMIT.decode(table)
    if low == high == 0:
        return "is in wheel mode (both its angle limits are 0)"
    lowest, highest = joint.bounds
    if lowest < low or highest > high:
        return f"has angle limits of {low}..{high} ticks, and the joint needs {lowest}..{highest}"
    if (level := m.STATUS_RETURN_LEVEL.decode(table)) != m.STATUS_RETURN_LEVEL.upper:
        return f"acknowledges no writes (status return level {level}, not {m.STATUS_RETURN_LEVEL.upper})"
    return ""


def restore(bus: Bus, joint: Joint) -> None:
    """Give the servo its torque limit and speed, and the torque that was last asked for; as found if nobody asked.

    One that has shut itself down stays so. Raises NoReply, NotConnected, BadRequest.
    """
    servo = joint.spec.id
    joint.goal = None
    joint.shut = bus.read(servo, m.TORQUE_LIMIT) == 0
    if joint.wanted is False:
        bus.write(servo, m.TORQUE_ENABLE, 0)
    if not joint.shut:
        bus.write(servo, m.TORQUE_LIMIT, round(joint.spec.torque_limit * m.FULL))
        bus.write(servo, m.MOVING_SPEED, joint.model.speed_ticks(joint.limits.speed))
        if joint.wanted:
            stiffen(bus, joint)
    joint.torque = bool(bus.read(servo, m.TORQUE_ENABLE))
