"""Selection of the parts of a new robot: from connected devices, from a similar robot, and from all drivers."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from typing import Any

import yaml

from config.defaults import user_files
from config.diagnostics import InvalidFileError
from config.file_io import read_regular_text
from config.library import find_file, shipped_files
from config.robot import PART_NAME, RobotKeys
from config.units import si_value
from drivers.api.driver import BrokenDriver, Driver
from drivers.api.keys import declared_keys
from drivers.api.kinds import KINDS
from drivers.finding.hardware_scan import HardwareScan
from drivers.servos.declared import DynamixelKeys
from missions.library.catalogue import EXAMPLE_VALUES
from missions.library.drivers import DriverTable, load_robot
from missions.plugins.setup.robot.device_scan import ProbedDevice
from missions.plugins.setup.robot.dialogue import Dialogue
from missions.plugins.setup.robot.parts import RobotPart

NONE = "none"

RobotParts = dict[str, RobotPart]
"""Parts of the new robot by name; the name of the first part of a kind is the kind, such as "camera"."""


@dataclass(frozen=True, slots=True)
class ReferenceRobot:
    """A known robot that the new one resembles: the drivers and file sections of its parts."""

    name: str
    summary: str
    drivers: Mapping[str, Driver]
    sections: Mapping[str, dict[str, Any]]
    arm: DynamixelKeys | None = None

    @property
    def servos(self) -> Mapping[int, str]:
        """Models of the servos of the robot's arm, by ID."""
        return {} if self.arm is None else {joint.id: joint.model for joint in self.arm.joints.values()}

    @property
    def holds_at_end(self) -> bool:
        """Whether the robot's arm holds its position at the end of a run."""
        return self.arm is None or self.arm.at_end == "hold"

    def matches(self, device: ProbedDevice) -> bool:
        """Return whether the robot's arm has the same servos as a probed device: their IDs and models are equal."""
        units = {number: model for number, model, _ in device.units}
        alike = all(model in ("?", self.servos[number]) for number, model in units.items() if number in self.servos)
        return alike and units.keys() == self.servos.keys()

    def section(self, part: str) -> dict[str, Any]:
        """Return the section of a part in the robot file, without its driver."""
        return {key: it for key, it in self.sections[part].items() if key not in {"driver", "kind"}}


def choose_reference(talk: Dialogue, devices: Sequence[ProbedDevice]) -> ReferenceRobot | None:
    """Ask which known robot is similar; the default is the one with the most devices in common.

    If several match equally, there is no default. With --yes there is no question: one of them is taken, if possible
    one whose arm holds its position at the end of a run, and its torque is reduced. Return None if the user selects
    none.
    """
    models = [
        model
        for name in (shipped_files("robots") | user_files("robots"))
        if (model := _load_reference(name)) is not None
    ]
    fitting = sorted(models, key=partial(_likeness, devices), reverse=True)
    names = [NONE, *(model.name for model in fitting)]
    equal = _equal_matches(devices, fitting)
    if len(equal) > 1:
        talk.print("several robots match the connected devices equally:")
        talk.print(*(f"  {model.name}: {model.summary}{_end_note(model)}" for model in equal))
        proposed: str | None = None
        if talk.yes and not talk.has_answer("like"):
            safe = _with_gentle_torque(max(equal, key=lambda model: model.holds_at_end))
            talk.print(
                f"{safe.name} is taken, with {GENTLE_TORQUE} of the torque: `mission robot new` without --yes asks"
            )
            return safe
    else:
        proposed = fitting[0].name if fitting and _likeness(devices, fitting[0]) > 0 else NONE
    question = "which of these robots is similar? its names, limits and values are used"
    chosen = talk.ask_choice("like", question, names, proposed, {model.name: model.summary for model in fitting})
    return next((model for model in fitting if model.name == chosen), None)


def _equal_matches(devices: Sequence[ProbedDevice], references: Sequence[ReferenceRobot]) -> list[ReferenceRobot]:
    """Return those of the ``references`` that match the connected devices as well as the first (best) one does.

    Only robots whose arm has the same servos as one of the devices are returned.
    """
    arms = [each for each in devices if each.units]
    best = [
        model for model in references if round(_likeness(devices, model)) == round(_likeness(devices, references[0]))
    ]
    return [model for model in best if any(_same_arm(each, model) for each in arms)]


def _same_arm(device: ProbedDevice, reference: ReferenceRobot) -> bool:
    return reference.drivers.get(device.driver.kind) == device.driver and reference.matches(device)


def _end_note(reference: ReferenceRobot) -> str:
    """Return a note on whether the robot's arm holds its position at the end of a run."""
    return " (its arm holds its position)" if reference.holds_at_end else " (the torque of its arm goes off at the end)"


GENTLE_TORQUE = "50 %"
"""Maximum torque of an arm's joints if --yes has selected one of several matching robots, so the arm may be another."""


def _with_gentle_torque(reference: ReferenceRobot) -> ReferenceRobot:
    """Return the robot with the torque of its arm's joints limited to ``GENTLE_TORQUE``."""
    if reference.arm is None:
        return reference
    limit = si_value(GENTLE_TORQUE, "share")
    strong = [name for name, joint in reference.arm.joints.items() if joint.torque > limit]
    arm = reference.sections["arm"]
    joints = {
        name: {**entry, "torque": GENTLE_TORQUE} if name in strong else entry for name, entry in arm["joints"].items()
    }
    return replace(reference, sections={**reference.sections, "arm": {**arm, "joints": joints}})


def _load_reference(name: str) -> ReferenceRobot | None:
    path = find_file("robots", name)
    try:
        config = load_robot(path)
    except InvalidFileError:
        return None
    raw = yaml.safe_load(read_regular_text(path))
    drivers = {part: section.driver for part, section in config.sections.items()}
    arm = config.sections["arm"].keys if "arm" in config.sections else None
    sections = {part: {**raw[part]} for part in drivers}
    return ReferenceRobot(name, config.summary, drivers, sections, arm if isinstance(arm, DynamixelKeys) else None)


def _likeness(devices: Sequence[ProbedDevice], reference: ReferenceRobot) -> float:
    """Return a score for how well the ``reference`` robot matches the connected devices.

    Each device that the robot has counts 1. A servo bus counts 2 more if its servos have the same IDs and models, else
    1 less.
    """
    score = 0.0
    for each in devices:
        if reference.drivers.get(each.driver.kind) == each.driver:
            score += 1.0
            if each.units:
                score += 2.0 if reference.matches(each) else -1.0
    return score - 0.01 * len(reference.drivers)


def choose_parts(
    talk: Dialogue,
    table: DriverTable,
    scan: HardwareScan,
    devices: Sequence[ProbedDevice],
    reference: ReferenceRobot | None,
) -> RobotParts:
    """Ask which parts the robot has; return the parts in the order of a robot file."""
    parts: RobotParts = {}
    for kind in KINDS:
        _choose_probed_parts(talk, parts, kind, [each for each in devices if each.driver.kind == kind], reference)
    for part in (*KINDS, *(() if reference is None else reference.drivers)):
        if part not in parts and (supposed := _choose_unprobed_part(talk, table, scan, part, reference)) is not None:
            parts[part] = supposed
    _choose_other_parts(talk, table, parts)
    if "camera" in parts and scan.cameras:
        parts["camera"].section["source"] = min(scan.cameras, key=lambda each: isinstance(each.source, str)).source
    return {part: parts[part] for part in (*KINDS, *parts) if part in parts}


def _choose_probed_parts(
    talk: Dialogue, parts: RobotParts, kind: str, devices: Sequence[ProbedDevice], reference: ReferenceRobot | None
) -> None:
    """Ask which probed device is the robot's part of this ``kind``, and for a name of each further one.

    The parts are added to ``parts``.
    """
    chosen = _choose_device(talk, kind, devices, reference)
    if chosen is None:
        return
    parts[kind] = _part_of_device(chosen, reference)
    for each in devices:
        if each is chosen:
            continue
        if KINDS[kind].allows_several:
            _add_part(
                talk,
                parts,
                f"name {each.port.call}",
                each.driver,
                _part_of_device(each, None),
                at=f" at {each.port.call}",
            )
        else:
            talk.print(
                f"a robot has only one {kind}: {_device_title(each)} needs another robot file (mission robot new)"
            )


def _choose_device(
    talk: Dialogue, kind: str, devices: Sequence[ProbedDevice], reference: ReferenceRobot | None
) -> ProbedDevice | None:
    """Ask which probed device is to be the robot's part of this kind; return None if the user wants none of them.

    The default is the device that the ``reference`` robot has.
    """
    if not devices:
        return None
    if len(devices) == 1:
        key = f"take {devices[0].port.call}"
        return (
            devices[0]
            if talk.ask_yes_no(key, f"use {_device_title(devices[0])} as its {kind}?", default=True)
            else None
        )
    named = {f"{each.driver.name} at {each.port.call}": each for each in devices}
    usual = [
        name for name, each in named.items() if reference is not None and reference.drivers.get(kind) == each.driver
    ]
    question = f"{len(devices)} devices could be its {kind}: which one?"
    chosen = talk.ask_choice(f"which {kind}", question, [*named, NONE], [*usual, *named][0])
    return named.get(chosen)


def _add_part(talk: Dialogue, parts: RobotParts, key: str, driver: Driver, part: RobotPart, at: str = "") -> None:
    """Ask for the name of a further part of a kind, as missions will use it; add the part, unless the user declines.

    The answer is saved under ``key``. ``at`` is the port of the part, as a text for the question.
    """
    kind = driver.kind
    reserved, such = {each.word for each in declared_keys(RobotKeys)} | set(KINDS), EXAMPLE_VALUES[kind]

    def check(answer: str) -> None:
        if answer == NONE:
            return
        if re.fullmatch(PART_NAME, answer) is None:
            raise ValueError(
                f"'{answer:.40}' is not a valid name: small letters, digits and _, beginning with a letter"
            )
        if answer in parts or answer in reserved:
            raise ValueError(f"'{answer}' is taken: choose another name, such as {such}")

    usual = next(name for number in count(2) if (name := f"{kind}{number}") not in parts)
    question = f"another {kind}, {driver.name}{at}: its name, such as {such}? '{NONE}' leaves it out"
    name = talk.ask_text(key, question, usual, check)
    if name != NONE:
        parts[name] = part


def _choose_unprobed_part(
    talk: Dialogue, table: DriverTable, scan: HardwareScan, part: str, reference: ReferenceRobot | None
) -> RobotPart | None:
    """Ask whether the robot has a part that was not found by probing; return the part, or None.

    The question offers the part of the ``reference`` robot. Without one, it offers a default part that needs no serial
    port, such as a camera.
    """
    driver = None if reference is None else reference.drivers.get(part)
    if reference is not None and driver is not None:
        question = f"does it have the {part} of {reference.name} ({driver.name})?"
        return (
            RobotPart(driver, reference.section(part))
            if talk.ask_yes_no(f"has {part}", question, default=True)
            else None
        )
    usual = _default_driver(part, scan)
    if usual and talk.ask_yes_no(f"has {part}", f"does it have a {part}?", default=usual != "page"):
        return RobotPart(table.find(part, usual))
    return None


def _choose_other_parts(talk: Dialogue, table: DriverTable, parts: RobotParts) -> None:
    """Ask about parts that cannot be probed, of any driver, including third-party ones."""
    free = [kind for kind, it in KINDS.items() if it.allows_several or kind not in parts or parts[kind].port is None]
    names = {f"{kind}.{name}": (kind, name) for kind in free for name in table.names(kind)}

    def check(answer: str) -> None:
        for word in _split_answer(answer):
            if word not in names:
                raise ValueError(f"'{word}' is not one of: {', '.join(names)}")
            try:
                table.find(*names[word])
            except BrokenDriver as error:
                raise ValueError(f"'{word}' cannot be used: {error}") from error

    if not (talk.yes or talk.has_answer("others")):
        talk.print("available drivers:")
        for kind in free:
            talk.print(f"  {kind}: {', '.join(f'{kind}.{name}' for name in table.names(kind))}")
    question = "other parts? none, or some of these, separated by commas"
    for place, word in enumerate(_split_answer(talk.ask_text("others", question, NONE, check))):
        driver = table.find(*names[word])
        _add_needed_parts(talk, table, parts, driver)
        if driver.kind in parts and KINDS[driver.kind].allows_several:
            _add_part(talk, parts, f"name {place} {word}", driver, RobotPart(driver))
        else:
            parts[driver.kind] = RobotPart(driver)


def _add_needed_parts(talk: Dialogue, table: DriverTable, parts: RobotParts, driver: Driver) -> None:
    """Add the parts without which a driver cannot work, such as the arm whose joints move a neck.

    A part is added only if there is a driver of the same name for it.
    """
    for need in driver.needs:
        if need not in parts and driver.name in table.names(need):
            talk.print(f"{driver.kind}.{driver.name} needs an {need}: {need}.{driver.name} is added")
            parts[need] = RobotPart(table.find(need, driver.name))


def _split_answer(answer: str) -> list[str]:
    return [] if answer == NONE else [word.strip() for word in answer.split(",")]


def _device_title(device: ProbedDevice) -> str:
    return f"{device.about or device.driver.about.rstrip('.')} at {device.port.path}"


def _part_of_device(device: ProbedDevice, reference: ReferenceRobot | None) -> RobotPart:
    section: dict[str, Any] = {}
    same_servos = reference is not None and reference.matches(device)
    if reference is not None and reference.drivers.get(device.driver.kind) == device.driver:
        section = reference.section(device.driver.kind)
        if device.units and not same_servos:
            section = {key: it for key, it in section.items() if key not in {"joints", "groups", "calibration"}}
    return RobotPart(
        device.driver,
        {
            **dict.fromkeys(("port", *section)),
            **section,
            **device.keys,
            "port": device.port.call,
        },  # keep the port first
        device.port,
        device.units,
    )


def _default_driver(kind: str, scan: HardwareScan) -> str:
    """Return the default driver for a kind of part that needs no serial port; empty if no such device is connected."""
    there = {
        "camera": bool(scan.cameras),
        "microphone": any(card.hears for card in scan.sound_cards),
        "voice": True,
        "screen": True,
    }
    return KINDS[kind].default_driver if there.get(kind, False) else ""
