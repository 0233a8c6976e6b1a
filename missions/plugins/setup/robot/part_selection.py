"""Which parts a new robot has: what was found, what a robot that it is like has, and all that there is a driver of."""

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
"""The parts of the new robot by their names: their kinds, or names of their own."""


@dataclass(frozen=True, slots=True)
class ReferenceRobot:
    """A robot that the new one is like: the drivers of its parts, and what its file says of each."""

    name: str
    summary: str
    drivers: Mapping[str, Driver]
    sections: Mapping[str, dict[str, Any]]
    arm: DynamixelKeys | None = None

    @property
    def servos(self) -> Mapping[int, str]:
        """The models of its arm's servos, by their IDs."""
        return {} if self.arm is None else {joint.id: joint.model for joint in self.arm.joints.values()}

    @property
    def holds_at_end(self) -> bool:
        """Whether its arm holds its position at the end of a run."""
        return self.arm is None or self.arm.at_end == "hold"

    def matches(self, device: ProbedDevice) -> bool:
        """Whether its arm has the servos that were found, by their IDs and models."""
        units = {number: model for number, model, _ in device.units}
        alike = all(model in ("?", self.servos[number]) for number, model in units.items() if number in self.servos)
        return alike and units.keys() == self.servos.keys()

    def section(self, part: str) -> dict[str, Any]:
        """Return what its file says of a part, but for the driver."""
        return {key: it for key, it in self.sections[part].items() if key not in {"driver", "kind"}}


def choose_reference(talk: Dialogue, devices: Sequence[ProbedDevice]) -> ReferenceRobot | None:
    """Ask which known robot the new one is like; the one that shares most with what is plugged in is proposed.

    Where several fit equally well none is proposed: with --yes the one is taken whose arm is safe.
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
        talk.print("several fit what is plugged in, and nothing tells them apart:")
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
    question = "which of these is it like? its names, limits and figures are taken over"
    chosen = talk.ask_choice("like", question, names, proposed)
    return next((model for model in fitting if model.name == chosen), None)


def _equal_matches(devices: Sequence[ProbedDevice], references: Sequence[ReferenceRobot]) -> list[ReferenceRobot]:
    """Return the robots whose arms fit the servos that were found, if they are several that fit equally well."""
    arms = [each for each in devices if each.units]
    best = [
        model for model in references if round(_likeness(devices, model)) == round(_likeness(devices, references[0]))
    ]
    return [model for model in best if any(_same_arm(each, model) for each in arms)]


def _same_arm(device: ProbedDevice, reference: ReferenceRobot) -> bool:
    return reference.drivers.get(device.driver.kind) == device.driver and reference.matches(device)


def _end_note(reference: ReferenceRobot) -> str:
    """Say what the arm of a robot does at the end of a run."""
    return " (its arm holds its position)" if reference.holds_at_end else " (its arm goes limp at the end)"


GENTLE_TORQUE = "50 %"
"""Highest torque of an arm whose kind the user has not confirmed."""


def _with_gentle_torque(reference: ReferenceRobot) -> ReferenceRobot:
    """Return the robot with an arm that has ``GENTLE_TORQUE`` torque at most."""
    if reference.arm is None:
        return reference
    limit = si_value(GENTLE_TORQUE, "share")
    strong = [name for name, joint in reference.arm.joints.items() if joint.torque > limit]
    arm = reference.sections["arm"]
    joints = {
        name: {**told, "torque": GENTLE_TORQUE} if name in strong else told for name, told in arm["joints"].items()
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
    """Return how much a robot has of what is plugged in; servos count if their IDs and models are the same."""
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
    """Ask which parts the robot has; return them in the order in which files have them."""
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
    """Ask for those of a kind that have answered: which is the robot's, and how one more is called."""
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
                f"a robot has one {kind}: {_device_title(each)} can be in a robot file of its own (mission robot new)"
            )


def _choose_device(
    talk: Dialogue, kind: str, devices: Sequence[ProbedDevice], reference: ReferenceRobot | None
) -> ProbedDevice | None:
    """Ask which of those that have answered is the robot's; one that its model has, too, is proposed."""
    if not devices:
        return None
    if len(devices) == 1:
        key = f"take {devices[0].port.call}"
        return (
            devices[0]
            if talk.ask_yes_no(key, f"take {_device_title(devices[0])} for its {kind}?", default=True)
            else None
        )
    named = {f"{each.driver.name} at {each.port.call}": each for each in devices}
    usual = [
        name for name, each in named.items() if reference is not None and reference.drivers.get(kind) == each.driver
    ]
    question = f"{len(devices)} answer that could be its {kind}: which is it?"
    chosen = talk.ask_choice(f"which {kind}", question, [*named, NONE], [*usual, *named][0])
    return named.get(chosen)


def _add_part(talk: Dialogue, parts: RobotParts, key: str, driver: Driver, part: RobotPart, at: str = "") -> None:
    """Ask how one more part of a kind is called; missions say that name."""
    kind = driver.kind
    reserved, such = {each.word for each in declared_keys(RobotKeys)} | set(KINDS), EXAMPLE_VALUES[kind]

    def check(answer: str) -> None:
        if answer == NONE:
            return
        if re.fullmatch(PART_NAME, answer) is None:
            raise ValueError(f"'{answer:.40}' is no name: small letters, digits and _, beginning with a letter")
        if answer in parts or answer in reserved:
            raise ValueError(f"'{answer}' is taken: give another name, such as {such}")

    usual = next(name for number in count(2) if (name := f"{kind}{number}") not in parts)
    question = f"one more {kind}, {driver.name}{at}: what is it called, such as {such}? '{NONE}' leaves it out"
    name = talk.ask_text(key, question, usual, check)
    if name != NONE:
        parts[name] = part


def _choose_unprobed_part(
    talk: Dialogue, table: DriverTable, scan: HardwareScan, part: str, reference: ReferenceRobot | None
) -> RobotPart | None:
    """Ask for a part that was not found: one of the robot that it is like, or one that needs no port."""
    driver = None if reference is None else reference.drivers.get(part)
    if reference is not None and driver is not None:
        question = f"has it the {part} of {reference.name} ({driver.name})?"
        return (
            RobotPart(driver, reference.section(part))
            if talk.ask_yes_no(f"has {part}", question, default=True)
            else None
        )
    usual = _default_driver(part, scan)
    if usual and talk.ask_yes_no(f"has {part}", f"has it a {part}?", default=usual != "page"):
        return RobotPart(table.find(part, usual))
    return None


def _choose_other_parts(talk: Dialogue, table: DriverTable, parts: RobotParts) -> None:
    """Ask for parts that do not say that they are there: by any driver, also one of another distribution."""
    free = [kind for kind, it in KINDS.items() if it.allows_several or kind not in parts or parts[kind].port is None]
    names = {f"{kind}.{name}": (kind, name) for kind in free for name in table.names(kind)}

    def check(answer: str) -> None:
        for word in _split_answer(answer):
            if word not in names:
                raise ValueError(f"'{word}' is none of: {', '.join(names)}")
            try:
                table.find(*names[word])
            except BrokenDriver as error:
                raise ValueError(f"'{word}' cannot be used: {error}") from error

    if not (talk.yes or talk.has_answer("others")):
        talk.print("what there is a driver of:")
        for kind in free:
            talk.print(f"  {kind}: {', '.join(f'{kind}.{name}' for name in table.names(kind))}")
    question = "what else has it? none, or some of these, with commas between them"
    for place, word in enumerate(_split_answer(talk.ask_text("others", question, NONE, check))):
        driver = table.find(*names[word])
        if driver.kind in parts and KINDS[driver.kind].allows_several:
            _add_part(talk, parts, f"name {place} {word}", driver, RobotPart(driver))
        else:
            parts[driver.kind] = RobotPart(driver)


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
        {**dict.fromkeys(("port", *section)), **section, **device.keys, "port": device.port.call},  # the port first
        device.port,
        device.units,
    )


def _default_driver(kind: str, scan: HardwareScan) -> str:
    """Return the driver of a part that a robot may have without a port; empty where nothing of it is plugged in."""
    there = {
        "camera": bool(scan.cameras),
        "microphone": any(card.hears for card in scan.sound_cards),
        "voice": True,
        "screen": True,
    }
    return KINDS[kind].default_driver if there.get(kind, False) else ""
