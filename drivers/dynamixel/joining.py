"""How a servo joins the robot: it is identified, then its volatile settings are restored; never its EEPROM."""

from contextlib import suppress

from drivers.dynamixel import wire2
from drivers.dynamixel.bus import TRIES, At, Bus
from drivers.dynamixel.identification import pings_alone, twin_evidence
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.models import model_of
from drivers.dynamixel.register import Block
from drivers.dynamixel.torque import enable, stiffen
from drivers.dynamixel.units import called
from drivers.errors import BadRequest, NoReply

NEEDED = (
    ("drive_mode", 0b111, 0, "is reversed, timed or driven by another"),
    ("operating_mode", 0xFF, 3, "does not go to positions"),
    ("homing_offset", -1, 0, "counts from elsewhere"),
    ("multi_turn_offset", -1, 0, "counts from elsewhere"),
    ("resolution_divider", 0xFF, 1, "counts in other steps"),
    ("status_return_level", 0xFF, 2, "acknowledges no writes"),
    ("response_level", 0xFF, 1, "acknowledges no writes"),
    ("mode", 0xFF, 0, "does not go to positions"),
    ("phase", 0b1_0100, 0b100, "counts speeds or turns in another way"),
    ("angular_resolution", 0xFF, 1, "counts in other steps"),
)
"""Registers, which bits of them count, what these must be, and what else is the matter. No model has them all."""


def difference(bus: Bus, joint: Joint) -> str:
    """Return in what the servo is not what the robot file says, all of it; empty when it may be driven.

    Raises NoReply, NotConnected.
    """
    number = bus.ping(joint.at, tries=1 if joint.failures else TRIES)
    if number != joint.model.number:
        known = model_of(number)
        return (
            f"is model {number} ({known.name if known else 'unknown'}), not {joint.model.number} ({joint.model.name})"
        )
    for block in (joint.model.table.setup, *joint.model.table.slow):
        read(bus, joint, block)
    if evidence := twin_evidence(bus, joint.at, joint.model):
        return f"shares its ID with another servo, or has a bad cable ({evidence})"
    return " and ".join(_range_faults(joint) + _mode_faults(joint))


def absence(bus: Bus, joint: Joint) -> str:
    """Return what is wrong with a servo that does not answer: it may speak the other protocol. Raises NotConnected."""
    damaged = bus.tally(joint.spec.id).corrupt
    if joint.reading.value is None and bus.answers_ping(joint.at, tries=1):
        if bus.tally(joint.spec.id).corrupt > damaged:
            return "sends damaged replies: it shares its ID with another servo, or has a bad cable"
        return str(pings_alone(joint.at)).partition(": ")[2] + ": it answers a ping, and no read"
    other = At(joint.spec.id, 1 if joint.at.protocol == 2 else 2)
    if joint.reading.value is None and other.id <= wire2.LAST_ID:
        with suppress(NoReply, BadRequest):
            told = bus.identify(other, tries=1)
            known, how = model_of(told.number), called(told.at.protocol)
            meant = f": write model: {known.name}" if known and known.protocol == told.at.protocol else ""
            return f"answers in {how} alone, as model {told.number}, not as {joint.model.name}{meant}"
    return "does not answer"


def restore(bus: Bus, joint: Joint, *, now: float) -> None:
    """Give the servo its torque limit and speed, and the torque that was last asked for; as found if nobody asked.

    Its slow registers have just been read. One that has shut itself down stays so. Raises NoReply, NotConnected,
    BadRequest.
    """
    table = joint.model.table
    joint.touched = True
    joint.goal = joint.sent = None
    joint.progress.hold(None)
    joint.shut = joint.down
    joint.torque = bool(joint.value("torque_enable"))
    if joint.wanted is False:
        bus.write(joint.at, table["torque_enable"], 0)
        joint.torque = False
    if joint.shut:
        if joint.torque and joint.at.protocol == "STS":
            enable(bus, joint, on=False)  # its force would return by itself, to an old goal
            joint.torque = False
        joint.unsettled = False
        return
    if "torque_mode" in table and joint.value("torque_mode"):
        if joint.torque:
            stiffen(bus, joint, now=now)  # it has ignored its goal, which may lie anywhere
        bus.write(joint.at, table["torque_mode"], 0)
    if "bus_watchdog" in table and joint.value("bus_watchdog"):
        bus.write(joint.at, table["bus_watchdog"], 0)  # else it fires, or has: then the goals are locked
    bus.write(joint.at, table[table.torque_limit], joint.torque_ticks)
    bus.write(joint.at, table[table.speed], joint.speed_ticks(joint.limits.speed))
    if joint.wanted:
        stiffen(bus, joint, now=now)
    joint.unsettled = False


def read(bus: Bus, joint: Joint, block: Block, *, tries: int = TRIES) -> None:
    """Read a block of the servo's table into the joint's copy. Raises NoReply, NotConnected, BadRequest."""
    joint.take(block, bus.read_block(joint.at, block.address, block.size, tries=tries))


def _range_faults(joint: Joint) -> list[str]:
    """Say in what the limits of the servo do not suit the joint."""
    low, high = (joint.value(register) for register in joint.model.table.limits)
    lowest, highest = joint.bounds
    if low == high == 0:
        mode = "multi-turn" if joint.at.protocol == "STS" else "wheel"
        return [f"is in {mode} mode (both its angle limits are 0)"]
    if low == high == joint.model.last:
        return [f"is in multi-turn mode (both its angle limits are {high})"]
    if lowest < low or highest > high:
        return [f"has angle limits of {low}..{high} ticks, and the joint needs {lowest}..{highest}"]
    return []


def _mode_faults(joint: Joint) -> list[str]:
    """Say in which other settings the servo does not do what its joint needs."""
    found = []
    for register, mask, needed, words in NEEDED:
        if register in joint.model.table and (value := joint.value(register)) & mask != needed:
            found.append(f"{words} ({register.replace('_', ' ')} {value}, not {value & ~mask | needed})")
    if joint.spec.offset is not None and (offset := joint.value("position_offset")) != joint.spec.offset:
        cure = "mission servo home --restore --robot FILE"
        found.append(f"has position offset {offset}, its calibration says {joint.spec.offset}: {cure}")
    return found
