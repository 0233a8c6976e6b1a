"""How a servo joins the robot: it is identified, then its volatile settings are restored; never its EEPROM."""

from contextlib import suppress
from math import ceil, degrees, floor

from drivers.errors import BadRequest, NoReply
from drivers.servos import wire2
from drivers.servos.bus import TRIES, At, Bus
from drivers.servos.identification import DOUBTED_GLANCES, DRIVER_GLANCES, UNPLUG, twin_evidence
from drivers.servos.joint import OVERFED, Joint
from drivers.servos.lerobot import Calibrated, calibration_of
from drivers.servos.models import model_of
from drivers.servos.register import Block
from drivers.servos.torque import enable, stiffen
from drivers.servos.units import called

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

CALIBRATION = ("homing_offset", "operating_mode", "drive_mode")
"""Registers of a Dynamixel that LeRobot sets as it calibrates an arm."""


def difference(bus: Bus, joint: Joint) -> str:
    """Return in what the servo is not what the robot file says, all of it; empty when it may be driven.

    What helps is left in the joint's ``cure``. Raises NoReply, NotConnected.
    """
    joint.cure = ""
    number = bus.ping(joint.at, tries=1 if joint.failures else TRIES)
    if number != joint.model.number:
        known = model_of(number)
        joint.cure = known.advice if known else f"mission servo scan --ids {joint.spec.id} --robot FILE"
        return (
            f"is model {number} ({known.name if known else 'unknown'}), not {joint.model.number} ({joint.model.name})"
        )
    for block in (joint.model.table.setup, *joint.model.table.slow):
        read(bus, joint, block)
    glances = DOUBTED_GLANCES if joint.shares_id else 0 if joint.reading.value is not None else DRIVER_GLANCES
    if evidence := twin_evidence(bus, joint.at, joint.model, glances=glances):
        joint.shares_id = True
        joint.cure = UNPLUG.format(joint.spec.id)
        return f"shares its ID with another servo, or has a bad cable ({evidence})"
    joint.shares_id = False
    faults = _power_faults(bus, joint) + _range_faults(joint) + _mode_faults(joint)
    joint.cure = "; ".join(dict.fromkeys(cure for _, cure in faults))
    return " and ".join(fault for fault, _ in faults)


def absence(bus: Bus, joint: Joint, corrupt: int) -> str:
    """Return what is wrong with a servo that does not answer: it may speak the other protocol. Raises NotConnected.

    ``corrupt`` is how many of its replies were damaged before it was looked for. What helps is left in the joint's
    ``cure``.
    """
    joint.cure = ""
    if joint.reading.value is not None:
        return "does not answer"
    pinged = bus.answers_ping(joint.at, tries=1)
    if bus.tally(joint.spec.id).corrupt > corrupt:
        joint.cure, joint.shares_id = UNPLUG.format(joint.spec.id), True
        return "sends damaged replies: it shares its ID with another servo, or has a bad cable"
    if pinged:
        joint.cure = f"mission servo set {joint.spec.id} status_return_level 2 --robot FILE"
        return "answers a ping, and no read: its status return level is 0"
    other = At(joint.spec.id, 1 if joint.at.protocol == 2 else 2)
    if other.id <= wire2.LAST_ID:
        with suppress(NoReply, BadRequest):
            told = bus.identify(other, tries=1)
            known, how = model_of(told.number), called(told.at.protocol)
            right = known is not None and known.protocol == told.at.protocol
            joint.cure = known.advice if known and right else f"mission servo info {joint.spec.id}"
            meant = f": {known.advice}" if known and right else ""
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


Trouble = tuple[str, str]
"""What keeps a servo from being driven, and what helps."""


def _setting(joint: Joint, register: str, value: int) -> str:
    """Return the command that changes a setting."""
    return f"mission servo set {joint.spec.id} {register} {value} --robot FILE"


def _power_faults(bus: Bus, joint: Joint) -> list[Trouble]:
    """Say that the servo gets more volts than it bears. Raises NoReply, NotConnected."""
    volts = bus.read(joint.at, joint.model.table["present_voltage"]) / 10
    highest = joint.value("highest_voltage") / 10
    if volts <= OVERFED * highest:
        return []
    kind = f"it is made for {joint.volts:g} V" + (
        ", and others with its model number for 12 V" if joint.at.protocol == "STS" else ""
    )
    cure = f"switch its supply off now; give servos of {joint.volts:g} V a supply of their own"
    return [(f"gets {volts:.1f} V, and bears {highest:.1f} V at most ({kind})", cure)]


def _range_faults(joint: Joint) -> list[Trouble]:
    """Say in what the limits of the servo do not suit the joint."""
    names, last = joint.model.table.limits, joint.model.last
    low, high = (joint.value(register) for register in names)
    lowest, highest = joint.bounds
    if low == high == 0:
        mode = "multi-turn" if joint.at.protocol == "STS" else "wheel"
        return [(f"is in {mode} mode (both its angle limits are 0)", _setting(joint, names[1], last))]
    if low == high == last:
        told = f"is in multi-turn mode (both its angle limits are {high})"
        return [(told, _setting(joint, names[0], 0))]
    if lowest < low or highest > high:
        told = f"has angle limits of {low}..{high} ticks, and the joint needs {lowest}..{highest}"
        return [(told, _narrower(joint, low, high))]
    return []


def _narrower(joint: Joint, low: int, high: int) -> str:
    """Return what helps where a servo goes less far than its joint: a servo that was calibrated is to stay so."""
    ends = sorted(degrees(joint.angle(end)) for end in (low, high))
    limits = f"write limits: [{ceil(ends[0])} deg, {floor(ends[1])} deg]"
    if joint.at.protocol != "STS":
        return f"{limits} in the robot file"
    if path := _lerobot_file(joint):
        return (
            f"LeRobot has calibrated it: write calibration: {path} in the robot file, and leave the limits out "
            "(mission robot new writes such a file)"
        )
    return (
        f"it was calibrated, by LeRobot perhaps: name its file in the robot file (calibration: {LEROBOT_FILES}) and "
        f"leave the limits out, or {limits}"
    )


LEROBOT_FILES = "~/.cache/huggingface/lerobot/calibration/robots/NAME/ID.json"
"""Where LeRobot keeps its calibrations."""


def _calibrated(joint: Joint) -> str:
    """Return what is said of a Dynamixel whose offset a program has set: this driver has no place for one."""
    path = _lerobot_file(joint, "homing_offset")
    who = f"LeRobot has calibrated it ({path})" if path else "another program has calibrated it, LeRobot perhaps,"
    return (
        f"{who} and needs its calibration: leave the arm to that program; Dynamixels are driven here that count from "
        "their own zero"
    )


def _lerobot_file(joint: Joint, offset: str = "position_offset") -> str:
    """Return LeRobot's calibration file that the settings of a servo come from; empty without one."""
    values = (joint.value(name) for name in (offset, "min_position", "max_position"))
    found = calibration_of({joint.spec.id: Calibrated(*values)})
    return found[0] if found else ""


def _recalibrated(joint: Joint) -> str:
    """Return what helps where a servo has another offset than its calibration file says."""
    if path := _lerobot_file(joint):
        return f"LeRobot has calibrated it anew: write calibration: {path} in the robot file"
    last = joint.model.last
    if (joint.value("position_offset"), joint.value("min_position"), joint.value("max_position")) == (0, 0, last):
        return "mission servo home --restore --robot FILE"  # as delivered: there is nothing to lose
    return (
        f"it was calibrated anew, or is another servo: name the file of that calibration (mission servo info "
        f"{joint.spec.id} --robot FILE shows what it holds)"
    )


def _mode_faults(joint: Joint) -> list[Trouble]:
    """Say in which other settings the servo does not do what its joint needs."""
    found = []
    table = joint.model.table
    for register, mask, needed, words in NEEDED:
        if register in table and (value := joint.value(register)) & mask != needed:
            right = value & ~mask | needed
            cure = _setting(joint, register, right)
            if register in CALIBRATION and "homing_offset" in table and joint.value("homing_offset"):
                cure = _calibrated(joint)
            found.append((f"{words} ({register.replace('_', ' ')} {value}, not {right})", cure))
    if "shadow_id" in table and (leader := joint.value("shadow_id")) <= wire2.LAST_ID:
        told = f"obeys what servo {leader} is sent (shadow id {leader}): they are two servos on one joint"
        found.append((told, f"leave joint {joint.name} out of the robot file: it turns with servo {leader}"))
    if joint.value(table.torque_ceiling) == 0:
        told = f"has no force ({table.torque_ceiling.replace('_', ' ')} 0)"
        most = joint.model.default(table[table.torque_ceiling])
        found.append((told, _setting(joint, table.torque_ceiling, most)))
    if joint.spec.offset is not None and (offset := joint.value("position_offset")) != joint.spec.offset:
        cure = _recalibrated(joint)
        found.append((f"has position offset {offset}, its calibration says {joint.spec.offset}: {cure}", cure))
    return found
