"""Servos of a new robot: duplicate IDs, joint names and limits."""

from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from math import ceil, degrees, floor, radians
from typing import Any

from config.robot import RobotConfig
from config.units import quantity_text
from drivers.clock import SystemClock
from drivers.errors import DriverError
from drivers.servos.bus import ServoAddress, ServoBus
from drivers.servos.bus_scan import ScannedServo, scan_bus
from drivers.servos.declared import DynamixelKeys, JointKeys
from drivers.servos.feetech import FeetechKeys
from drivers.servos.identification import require_unique_id
from drivers.servos.joint import Joint
from drivers.servos.lerobot import CalibrationSettings, is_wheel, match_calibration
from drivers.servos.make import joint_specs as specs
from drivers.servos.models import MODELS
from drivers.servos.probe import DUPLICATE_ID, PROBED_IDS
from drivers.servos.settings import apply_changes, plan_changes
from drivers.servos.units import baud_code
from missions.plugins.setup.robot.dialogue import Dialogue
from missions.plugins.setup.robot.parts import RobotPart
from missions.plugins.setup.servo.calibrate import JointTravel
from missions.plugins.setup.servo.connections import REPLY_TIMEOUT
from missions.plugins.setup.servo.ranges import with_range

LIMIT_MARGIN = radians(2)
"""Distance of a joint's limits from its mechanical ends, in radians."""

FACTORY_BAUD_RATES = (1_000_000, 57_600)


@contextmanager
def open_servo_bus(path: str, baud: int, extra_timeout: float) -> Iterator[ServoBus]:
    """Open the servo bus on a serial port; close it at the end. Raises NotConnected."""
    with closing(ServoBus(path, SystemClock(), baud=baud, reply_timeout=extra_timeout)) as bus:
        bus.open()
        yield bus


def name_joints(talk: Dialogue, arm: str, part: RobotPart) -> None:
    """Ask for the joint name of each servo of ``arm``, unless its section in the robot file has joints."""
    if "joints" in part.section:
        return
    joints: dict[str, dict[str, Any]] = {}

    def check(answer: str) -> None:
        if not answer.isidentifier():
            raise ValueError(f"'{answer}' is not a valid name: letters, digits and _")
        if answer in joints:
            raise ValueError(f"'{answer}' is already servo {joints[answer]['id']}")

    usual = JointKeys(id=0).model
    if not part.units:
        talk.print("no servo replied: IDs from 1 on are assumed")
        count = int(talk.ask_text(f"{arm} count", f"how many servos does the {arm} have?", "1", _check_count))
        kind = _ask_model(talk, f"{arm} model", f"which model are the servos of the {arm}?", part, usual)
        part.units = tuple((number, kind, "") for number in range(1, count + 1))
    for number, reported, _ in sorted(part.units):
        model = reported
        if reported not in MODELS:
            question = f"which model is servo {number}, which reports {reported}? '{NO_MODEL}' leaves it out"
            model = _ask_model(talk, f"{arm} model {number}", question, part, NO_MODEL)
            if model == NO_MODEL:
                talk.print(f"  servo {number} is left out")
                continue
        of = "" if arm == "arm" else f" of the {arm}"
        question = f"what does servo {number}{of} ({model}) move?"
        name = talk.ask_text(f"{arm} joint {number}", question, f"joint{number}", check)
        joints[name] = {"id": number} | ({} if model == usual else {"model": model})
    part.section["joints"] = joints


NO_MODEL = "none"


def _ask_model(talk: Dialogue, key: str, question: str, part: RobotPart, default: str) -> str:
    """Ask for the model of servos that report none, or an unknown one; return its name."""
    among = [name for name, model in MODELS.items() if (model.protocol == "STS") == (part.driver.name == "feetech")]
    usual = default if default in (NO_MODEL, *among) else among[0]

    def check(answer: str) -> None:
        if answer != usual and answer not in among:
            raise ValueError(f"'{answer:.40}' is none of: {', '.join(among)}")

    return talk.ask_text(key, question, usual, check)


def _check_count(answer: str) -> None:
    if not answer.isdecimal() or not 0 < int(answer) <= len(PROBED_IDS):
        raise ValueError(f"enter a number from 1 to {len(PROBED_IDS)}")


def assign_ids(talk: Dialogue, arm: str, part: RobotPart, path: str, *, extra_timeout: float = REPLY_TIMEOUT) -> None:
    """Assign new IDs to servos that share one, one after another; asks before each EEPROM write."""
    if not any(trouble == DUPLICATE_ID for _, _, trouble in part.units):
        return
    talk.print("two servos have the same ID; new servos all have ID 1")
    if talk.yes or not talk.ask_yes_no(f"{arm} ids", "give them new IDs now? it writes their EEPROM", default=False):
        talk.print("unchanged; later: mission servo set 1 id NEW --port PORT, with only one connected")
        return
    baud, taken = int(part.section.get("baud", FACTORY_BAUD_RATES[0])), dict[int, str]()
    while True:
        step = f"{arm} id {len(taken)}"
        question = "connect only one servo; what is its new ID? 'done' after the last"
        free = next(number for number in range(1, len(PROBED_IDS)) if number not in taken)
        answer = talk.ask_text(step, question, str(free), lambda said: said == "done" or _check_new_id(said, taken))
        if answer == "done":
            break
        model = talk.measure_once(f"{step} model", lambda: _assign_id(talk, path, baud, int(answer), extra_timeout))  # noqa: B023
        if not model:
            talk.forget_answers(step)
            continue
        taken[int(answer)] = model
    part.units = tuple((number, model, "") for number, model in taken.items())
    if taken:
        talk.print("connect all servos again")


def _check_new_id(answer: str, taken: Mapping[int, str]) -> bool:
    if not answer.isdecimal() or int(answer) not in range(253):
        raise ValueError(f"'{answer}' is not an ID: 0 to 252")
    if int(answer) in taken:
        raise ValueError(f"{answer} is assigned already")
    return True


def _assign_id(talk: Dialogue, path: str, baud: int, new: int, extra_timeout: float) -> str:
    """Assign the ID ``new`` to the only connected servo; return its model, or an empty text if that failed."""
    try:
        with open_servo_bus(path, baud, extra_timeout) as bus:
            found = list(scan_bus(bus, tuple(dict.fromkeys((baud, *FACTORY_BAUD_RATES))), ids=PROBED_IDS))
            one = found[0] if len(found) == 1 else None
            if one is None or one.model is None or one.has_damaged_replies:
                talk.print(f"  {len(found) or 'no'} servos reply, or the model is unknown: connect only one")
                return ""
            return one.model.name if _write_id(talk, bus, one, new, baud) else ""
    except DriverError as error:
        talk.print(f"  {error}")
        return ""


def _write_id(talk: Dialogue, bus: ServoBus, one: ScannedServo, new: int, baud: int) -> bool:
    """Write ID and baud rate of a servo if the user agrees; return whether the servo has them now."""
    if one.model is None:
        return False
    bus.baud = one.baud
    values = {"id": new} | ({} if one.baud == baud else {"baud": baud_code(baud, one.model.protocol)})
    changes = plan_changes(bus, one.address, one.model.table, values)
    change_text = ", ".join(f"{change.register.name} {change.before} -> {change.after}" for change in changes)
    if changes and not talk.ask_irreversible(f"  {one.model.name}: write {change_text} into the EEPROM?"):
        return False
    apply_changes(bus, one.address, one.model.table, changes)
    talk.print(f"  {one.model.name} has ID {new}")
    return True


def find_limits(
    talk: Dialogue, name: str, part: RobotPart, config: RobotConfig, path: str, *, extra_timeout: float = REPLY_TIMEOUT
) -> None:
    """Find the limits of an arm's joints, if the user agrees.

    The torque goes off, and the user moves each joint to both ends by hand.
    """
    arm = config.sections[name].keys
    if not isinstance(arm, DynamixelKeys) or talk.yes or part.port is None or "calibration" in part.section:
        return
    question = f"find the limits of the {name}'s joints by hand? their torque goes off: hold the {name}, it falls"
    if not talk.has_answer(f"{name} ranges") and not talk.ask_consent(f"{name} limits", question):
        return
    joints = {joint: Joint(joint, spec, MODELS[spec.model]) for joint, spec in specs(arm).items()}

    def measure() -> dict[str, tuple[int, int]]:
        with open_servo_bus(path, arm.baud, extra_timeout) as bus:
            return _watch_joints(talk, bus, joints)

    ends = talk.measure_once(f"{name} ranges", measure)
    joint_entries = {str(joint): dict(entries) for joint, entries in part.section["joints"].items()}
    for joint, (lowest, highest) in ends.items():
        turned = JointTravel(joints[joint], lowest, highest)
        if (servo_range := turned.range_within(LIMIT_MARGIN)) is None:
            talk.print(f"  {joint} hardly moved: unchanged")
            continue
        new = with_range(arm.joints[joint], servo_range)
        if new.ticks is not None:
            joint_entries[joint]["ticks"] = {"init": new.ticks.init, "min": new.ticks.min, "max": new.ticks.max}
        else:
            lower, upper = ceil(10 * degrees(new.lower)) / 10, floor(10 * degrees(new.upper)) / 10  # round inwards
            joint_entries[joint]["limits"] = [f"{lower + 0.0:g} deg", f"{upper + 0.0:g} deg"]
    part.section["joints"] = joint_entries


def _watch_joints(talk: Dialogue, bus: ServoBus, joints: Mapping[str, Joint]) -> dict[str, tuple[int, int]]:
    """Switch the torque of an arm off, and return the range (steps) in which each joint is moved until Enter.

    Each servo is identified before its torque goes off.
    """
    turned = []
    for joint in joints.values():
        require_unique_id(bus, joint.address, joint.model.number)
    for joint in joints.values():
        bus.write(joint.address, joint.model.table["torque_enable"], 0)
        ticks = bus.read(joint.address, joint.model.table["present_position"])
        turned.append(JointTravel(joint, ticks, ticks))

    def look() -> None:
        for each in turned:
            each.sample(bus)

    talk.watch_until_enter(look, "turn each joint to both its ends by hand; then press Enter")
    return {each.joint.name: (each.lowest, each.highest) for each in turned}


# Servos that LeRobot or another program calibrated: use its file, or their limits.

CALIBRATION_REGISTERS = ("position_offset", "min_position", "max_position")
"""Servo registers that hold a calibration, in the order of the fields of ``CalibrationSettings``."""

CALIBRATION_KEYS = ("limits", "zero", "reverse", "ticks")
"""Keys of a joint in a robot file that a calibration file replaces."""


def offer_calibration(talk: Dialogue, arm: str, part: RobotPart, path: str, *, extra_timeout: float) -> None:
    """Offer the calibration file that matches the servos of ``arm``. Servos are only read, not changed."""
    held = _calibrated_registers(talk, arm, part, path, extra_timeout)
    found = match_calibration(held) if held else None
    if found is None:
        return
    file, names = found
    question = f"LeRobot has calibrated the {arm} ({file}): use this calibration?"
    if not talk.ask_yes_no(f"{arm} calibration", question, default=True):
        return
    known = {joint["id"]: joint for joint in part.section.get("joints", {}).values()}
    part.section["joints"] = {
        name: {"id": number} | {key: it for key, it in known.get(number, {}).items() if key not in CALIBRATION_KEYS}
        for number, name in names.items()
        if not is_wheel(name)
    }
    part.section = {"calibration": file, **part.section}
    groups = part.section.get("groups", {})
    if not all(joint in names.values() for group in groups.values() for joint in group):
        del part.section["groups"]


def adopt_limits(talk: Dialogue, arm: str, part: RobotPart, path: str, *, extra_timeout: float) -> None:
    """Take over the limits stored in servos that were calibrated, but whose calibration file is not on this computer.

    Nothing is written to a servo.
    """
    held = _calibrated_registers(talk, arm, part, path, extra_timeout)
    if not held or "calibration" in part.section:
        return
    talk.print(
        f"servos of the {arm} were calibrated by another program: their limits are used",
        "  its file is better, if you have it: `calibration: FILE` in the robot file",
    )
    models = {number: model for number, model, _ in part.units}
    for joint in part.section["joints"].values():
        if joint["id"] in held and "ticks" not in joint:
            model, limits = MODELS[models[joint["id"]]], held[joint["id"]]
            way = -1 if joint.get("reverse") else 1
            ends = sorted(model.angle(end) * way for end in (limits.low, limits.high))
            joint.pop("zero", None)
            joint["limits"] = [quantity_text(end, "angle") for end in ends]


def _calibrated_registers(
    talk: Dialogue, arm: str, part: RobotPart, path: str, extra_timeout: float
) -> Mapping[int, CalibrationSettings]:
    """Return the calibration that the servos of an arm store, by servo ID.

    It is empty if the servos have factory settings, or are not from Feetech.
    """
    if part.driver.keys is not FeetechKeys or not part.units:
        return {}
    found: dict[str, Any] = talk.measure_once(
        f"{arm} calibrated", lambda: _read_registers(talk, part, path, extra_timeout)
    )
    held = {int(number): CalibrationSettings(*values) for number, values in found.items()}
    plain = CalibrationSettings(0, 0, MODELS["STS3215"].last_tick)
    return held if any(values != plain for values in held.values()) else {}


def _read_registers(talk: Dialogue, part: RobotPart, path: str, extra_timeout: float) -> dict[str, list[int]]:
    """Return the calibration registers of the arm's servos by ID; empty if one of them does not reply.

    Servos of an unknown model are left out.
    """
    found = {}
    try:
        with open_servo_bus(path, int(part.section.get("baud", 1_000_000)), extra_timeout) as bus:
            for number, name, _ in part.units:
                if name in MODELS:
                    table = MODELS[name].table
                    found[str(number)] = [
                        bus.read(ServoAddress(number, "STS"), table[register]) for register in CALIBRATION_REGISTERS
                    ]
    except DriverError as error:
        talk.print(f"calibration of the servos unknown: {error}")
        return {}
    return found
