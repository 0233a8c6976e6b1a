"""Setup of a servo when it joins the robot: identify it, then restore its volatile settings; never its EEPROM."""

from contextlib import suppress
from math import ceil, degrees, floor

from drivers.errors import BadRequest, NoReply
from drivers.servos import wire2
from drivers.servos.bus import MAX_READ_ATTEMPTS, ServoAddress, ServoBus
from drivers.servos.identification import DOUBTED_QUICK_READS, DRIVER_QUICK_READS, UNPLUG_HINT, duplicate_id_evidence
from drivers.servos.joint import OVERVOLTAGE_FACTOR, Joint
from drivers.servos.lerobot import CalibrationSettings, match_calibration
from drivers.servos.models import find_model
from drivers.servos.register import RegisterBlock
from drivers.servos.torque import set_torque, stiffen
from drivers.servos.units import protocol_name

REQUIRED_SETTINGS = (
    ("drive_mode", 0b111, 0, "is reversed, timed or driven by another"),
    ("operating_mode", 0xFF, 3, "is not in position mode"),
    ("homing_offset", -1, 0, "has another zero"),
    ("multi_turn_offset", -1, 0, "has another zero"),
    ("resolution_divider", 0xFF, 1, "has another resolution"),
    ("status_return_level", 0xFF, 2, "does not acknowledge writes"),
    ("response_level", 0xFF, 1, "does not acknowledge writes"),
    ("mode", 0xFF, 0, "is not in position mode"),
    ("phase", 0b1_0100, 0b100, "has other units of speed or turns"),
    ("angular_resolution", 0xFF, 1, "has another resolution"),
)
"""Settings that a servo must have: register, mask of its bits that count, required value, and message if it differs."""

CALIBRATION_REGISTERS = ("homing_offset", "operating_mode", "drive_mode")
"""Registers of a Dynamixel that LeRobot sets when it calibrates an arm."""


def find_mismatch(bus: ServoBus, joint: Joint) -> str:
    """Return all differences between the servo and its robot file; empty if it may be driven.

    Sets the joint's ``hint``. Raises NoReply, NotConnected.
    """
    joint.hint = ""
    number = bus.ping(joint.address, tries=1 if joint.missed_reads else MAX_READ_ATTEMPTS)
    if number != joint.model.number:
        known = find_model(number)
        joint.hint = known.robot_file_hint if known else f"mission servo scan --ids {joint.spec.id} --robot FILE"
        return (
            f"is model {number} ({known.name if known else 'unknown'}), not {joint.model.number} ({joint.model.name})"
        )
    for block in (joint.model.table.setup_block, *joint.model.table.slow_blocks):
        read_table_block(bus, joint, block)
    glances = DOUBTED_QUICK_READS if joint.shares_id else 0 if joint.reading.value is not None else DRIVER_QUICK_READS
    if evidence := duplicate_id_evidence(bus, joint.address, joint.model, quick_reads=glances):
        joint.shares_id = True
        joint.hint = UNPLUG_HINT.format(joint.spec.id)
        return f"shares its ID with another servo, or has a bad cable ({evidence})"
    joint.shares_id = False
    faults = _power_faults(bus, joint) + _range_faults(joint) + _mode_faults(joint)
    joint.hint = "; ".join(dict.fromkeys(cure for _, cure in faults))
    return " and ".join(fault for fault, _ in faults)


def diagnose_no_reply(bus: ServoBus, joint: Joint, corrupt: int) -> str:
    """Return why a servo does not answer, such as another protocol or an ID that it shares. Raises NotConnected.

    ``corrupt`` is its number of damaged replies before the request. Sets the joint's ``hint``.
    """
    joint.hint = ""
    if joint.reading.value is not None:
        return "does not answer"
    pinged = bus.answers_ping(joint.address, tries=1)
    if bus.statistics(joint.spec.id).corrupt > corrupt:
        joint.hint, joint.shares_id = UNPLUG_HINT.format(joint.spec.id), True
        return "sends damaged replies: it shares its ID with another servo, or has a bad cable"
    if pinged:
        joint.hint = f"mission servo set {joint.spec.id} status_return_level 2 --robot FILE"
        return "answers a ping, but no read: its status return level is 0"
    other = ServoAddress(joint.spec.id, 1 if joint.address.protocol == 2 else 2)
    if other.id <= wire2.LAST_ID:
        with suppress(NoReply, BadRequest):
            told = bus.identify(other, tries=1)
            known, how = find_model(told.number), protocol_name(told.address.protocol)
            right = known is not None and known.protocol == told.address.protocol
            joint.hint = known.robot_file_hint if known and right else f"mission servo info {joint.spec.id}"
            meant = f": {known.robot_file_hint}" if known and right else ""
            return f"answers only in {how}, as model {told.number}, not as {joint.model.name}{meant}"
    return "does not answer"


def restore_settings(bus: ServoBus, joint: Joint, *, now: float) -> None:
    """Restore torque limit, speed, and the last requested torque state of a servo that was just identified.

    If no hold, move or relax was requested yet, the torque stays on or off as it is. A servo that has shut down stays
    shut down. The slow registers must have been read just before. Raises NoReply, NotConnected, BadRequest.
    """
    table = joint.model.table
    joint.may_have_torque = True
    joint.goal = joint.setpoint = None
    joint.progress.hold(None)
    joint.is_shut_down = joint.reports_shutdown
    joint.torque = bool(joint.value("torque_enable"))
    if joint.torque_request is False:
        bus.write(joint.address, table["torque_enable"], 0)
        joint.torque = False
    if joint.is_shut_down:
        if joint.torque and joint.address.protocol == "STS":
            set_torque(bus, joint, on=False)  # else its torque would return by itself, to an old goal
            joint.torque = False
        joint.is_unconfirmed = False
        return
    if "torque_mode" in table and joint.value("torque_mode"):
        if joint.torque:
            stiffen(bus, joint, now=now)  # in torque mode it ignored its goal, which may be anywhere
        bus.write(joint.address, table["torque_mode"], 0)
    if "bus_watchdog" in table and joint.value("bus_watchdog"):
        bus.write(joint.address, table["bus_watchdog"], 0)  # once fired, it locks the goals
    bus.write(joint.address, table[table.torque_limit], joint.torque_ticks)
    bus.write(joint.address, table[table.speed], joint.speed_ticks(joint.limits.speed))
    if joint.torque_request:
        stiffen(bus, joint, now=now)
    joint.is_unconfirmed = False


def read_table_block(bus: ServoBus, joint: Joint, block: RegisterBlock, *, tries: int = MAX_READ_ATTEMPTS) -> None:
    """Read a block of the servo's control table into ``joint.table``. Raises NoReply, NotConnected, BadRequest."""
    joint.store(block, bus.read_block(joint.address, block.address, block.size, tries=tries))


Mismatch = tuple[str, str]
"""Reason why a servo is not driven, and a hint how to remove that reason."""


def _set_command(joint: Joint, register: str, value: int) -> str:
    """Return the command to type that changes a setting of the joint's servo."""
    return f"mission servo set {joint.spec.id} {register} {value} --robot FILE"


def _power_faults(bus: ServoBus, joint: Joint) -> list[Mismatch]:
    """Return a mismatch if the supply voltage is too high for the servo. Raises NoReply, NotConnected."""
    volts = bus.read(joint.address, joint.model.table["present_voltage"]) / 10
    highest = joint.value("highest_voltage") / 10
    if volts <= OVERVOLTAGE_FACTOR * highest:
        return []
    kind = f"it is made for {joint.nominal_voltage:g} V" + (
        ", and others with its model number for 12 V" if joint.address.protocol == "STS" else ""
    )
    cure = f"switch its supply off now; give servos of {joint.nominal_voltage:g} V a supply of their own"
    return [(f"gets {volts:.1f} V, but allows {highest:.1f} V at most ({kind})", cure)]


def _range_faults(joint: Joint) -> list[Mismatch]:
    """Return mismatches between the servo's angle limits and the joint's."""
    names, last = joint.model.table.limit_registers, joint.model.last_tick
    low, high = (joint.value(register) for register in names)
    lowest, highest = joint.tick_limits
    if low == high == 0:
        mode = "multi-turn" if joint.address.protocol == "STS" else "wheel"
        return [(f"is in {mode} mode (both its angle limits are 0)", _set_command(joint, names[1], last))]
    if low == high == last:
        told = f"is in multi-turn mode (both its angle limits are {high})"
        return [(told, _set_command(joint, names[0], 0))]
    if lowest < low or highest > high:
        told = f"has angle limits of {low}..{high} ticks, but the joint needs {lowest}..{highest}"
        return [(told, _range_hint(joint, low, high))]
    return []


def _range_hint(joint: Joint, low: int, high: int) -> str:
    """Return the hint for a servo with a smaller range, ``low`` to ``high`` (steps), than its joint has.

    If LeRobot has calibrated the servo, the hint names the calibration file, so that the user keeps its settings.
    """
    ends = sorted(degrees(joint.angle(end)) for end in (low, high))
    limits = f"write limits: [{ceil(ends[0])} deg, {floor(ends[1])} deg]"
    if joint.address.protocol != "STS":
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
"""Path pattern of LeRobot's calibration files."""


def _calibrated_hint(joint: Joint) -> str:
    """Return the hint for a Dynamixel with an offset, which this driver does not support."""
    path = _lerobot_file(joint, "homing_offset")
    who = f"LeRobot has calibrated it ({path})" if path else "another program has calibrated it, LeRobot perhaps,"
    return (
        f"{who} and needs its calibration: leave the arm to that program; only Dynamixels "
        "without an offset are driven here"
    )


def _lerobot_file(joint: Joint, offset: str = "position_offset") -> str:
    """Return the path of LeRobot's calibration file that matches the servo's settings; empty if there is none."""
    values = (joint.value(name) for name in (offset, "min_position", "max_position"))
    found = match_calibration({joint.spec.id: CalibrationSettings(*values)})
    return found[0] if found else ""


def _offset_hint(joint: Joint) -> str:
    """Return the hint for a servo whose offset differs from its calibration file."""
    if path := _lerobot_file(joint):
        return f"LeRobot has recalibrated it: write calibration: {path} in the robot file"
    last = joint.model.last_tick
    if (joint.value("position_offset"), joint.value("min_position"), joint.value("max_position")) == (0, 0, last):
        return "mission servo home --restore --robot FILE"  # as delivered: nothing to lose
    return (
        f"it was recalibrated or replaced: name the file of that calibration (mission servo info "
        f"{joint.spec.id} --robot FILE shows its settings)"
    )


def _mode_faults(joint: Joint) -> list[Mismatch]:
    """Return mismatches in the settings of the joint's servo other than its angle limits."""
    found = []
    table = joint.model.table
    for register, mask, needed, words in REQUIRED_SETTINGS:
        if register in table and (value := joint.value(register)) & mask != needed:
            right = value & ~mask | needed
            cure = _set_command(joint, register, right)
            if register in CALIBRATION_REGISTERS and "homing_offset" in table and joint.value("homing_offset"):
                cure = _calibrated_hint(joint)
            found.append((f"{words} ({register.replace('_', ' ')} {value}, not {right})", cure))
    if "shadow_id" in table and (leader := joint.value("shadow_id")) <= wire2.LAST_ID:
        told = f"obeys the commands of servo {leader} (shadow id {leader}): they are two servos on one joint"
        found.append((told, f"leave joint {joint.name} out of the robot file: it turns with servo {leader}"))
    if joint.value(table.torque_ceiling) == 0:
        told = f"has no force ({table.torque_ceiling.replace('_', ' ')} 0)"
        most = joint.model.default(table[table.torque_ceiling])
        found.append((told, _set_command(joint, table.torque_ceiling, most)))
    if joint.spec.offset is not None and (offset := joint.value("position_offset")) != joint.spec.offset:
        cure = _offset_hint(joint)
        found.append((f"has position offset {offset}, its calibration says {joint.spec.offset}: {cure}", cure))
    return found
