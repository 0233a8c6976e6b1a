"""Which parts a new robot has: what was found, what a robot that it is like has, and all that there is a driver of."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from typing import Any

import yaml

from config.defaults import own_files
from config.faults import InvalidFileError
from config.library import find, shipped
from config.reading import read_regular_text
from config.robot import NAME, RobotKeys
from config.units import in_dimension
from drivers.api.driver import BrokenDriver, Driver
from drivers.api.keys import declared
from drivers.api.kinds import KINDS
from drivers.finding.survey import Desk
from drivers.servos.declared import DynamixelKeys
from missions.library.catalogue import WRITTEN
from missions.library.drivers import Table, load_robot
from missions.plugins.setup.robot.desk import Found
from missions.plugins.setup.robot.dialogue import Dialogue
from missions.plugins.setup.robot.parts import Part

NONE = "none"

Parts = dict[str, Part]
"""The parts of the new robot by their names: their kinds, or names of their own."""


@dataclass(frozen=True, slots=True)
class Model:
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
    def holds(self) -> bool:
        """Whether its arm holds its position at the end of a run."""
        return self.arm is None or self.arm.at_end == "hold"

    def fits(self, found: Found) -> bool:
        """Whether its arm has the servos that were found, by their IDs and models."""
        units = {number: model for number, model, _ in found.units}
        alike = all(model in ("?", self.servos[number]) for number, model in units.items() if number in self.servos)
        return alike and units.keys() == self.servos.keys()

    def section(self, part: str) -> dict[str, Any]:
        """Return what its file says of a part, but for the driver."""
        return {key: it for key, it in self.sections[part].items() if key not in {"driver", "kind"}}


def like(talk: Dialogue, found: Sequence[Found]) -> Model | None:
    """Ask which known robot the new one is like; the one that shares most with what is plugged in is proposed.

    Where several fit equally well none is proposed: with --yes the one is taken whose arm is safe.
    """
    models = [model for name in (shipped("robots") | own_files("robots")) if (model := _model(name)) is not None]
    fitting = sorted(models, key=partial(_likeness, found), reverse=True)
    names = [NONE, *(model.name for model in fitting)]
    equal = _equal(found, fitting)
    if len(equal) > 1:
        talk.tell("several fit what is plugged in, and nothing tells them apart:")
        talk.tell(*(f"  {model.name}: {model.summary}{_rest_of(model)}" for model in equal))
        proposed: str | None = None
        if talk.yes and not talk.knows("like"):
            safe = _gentle(max(equal, key=lambda model: model.holds))
            talk.tell(f"{safe.name} is taken, with {GENTLE} of the torque: `mission robot new` without --yes asks")
            return safe
    else:
        proposed = fitting[0].name if fitting and _likeness(found, fitting[0]) > 0 else NONE
    question = "which of these is it like? its names, limits and figures are taken over"
    chosen = talk.choice("like", question, names, proposed)
    return next((model for model in fitting if model.name == chosen), None)


def _equal(found: Sequence[Found], fitting: Sequence[Model]) -> list[Model]:
    """Return the robots whose arms fit the servos that were found, if they are several that fit equally well."""
    arms = [each for each in found if each.units]
    best = [model for model in fitting if round(_likeness(found, model)) == round(_likeness(found, fitting[0]))]
    return [model for model in best if any(_same_arm(each, model) for each in arms)]


def _same_arm(found: Found, model: Model) -> bool:
    return model.drivers.get(found.driver.kind) == found.driver and model.fits(found)


def _rest_of(model: Model) -> str:
    """Say what the arm of a robot does at the end of a run."""
    return " (its arm holds its position)" if model.holds else " (its arm goes limp at the end)"


GENTLE = "50 %"
"""Highest torque of an arm whose kind the user has not confirmed."""


def _gentle(model: Model) -> Model:
    """Return the robot with an arm that has ``GENTLE`` torque at most."""
    if model.arm is None:
        return model
    limit = in_dimension(GENTLE, "share")
    strong = [name for name, joint in model.arm.joints.items() if joint.torque > limit]
    arm = model.sections["arm"]
    joints = {name: {**told, "torque": GENTLE} if name in strong else told for name, told in arm["joints"].items()}
    return replace(model, sections={**model.sections, "arm": {**arm, "joints": joints}})


def _model(name: str) -> Model | None:
    path = find("robots", name)
    try:
        config = load_robot(path)
    except InvalidFileError:
        return None
    raw = yaml.safe_load(read_regular_text(path))
    drivers = {part: section.driver for part, section in config.sections.items()}
    arm = config.sections["arm"].keys if "arm" in config.sections else None
    sections = {part: {**raw[part]} for part in drivers}
    return Model(name, config.summary, drivers, sections, arm if isinstance(arm, DynamixelKeys) else None)


def _likeness(found: Sequence[Found], model: Model) -> float:
    """Return how much a robot has of what is plugged in; servos count if their IDs and models are the same."""
    score = 0.0
    for each in found:
        if model.drivers.get(each.driver.kind) == each.driver:
            score += 1.0
            if each.units:
                score += 2.0 if model.fits(each) else -1.0
    return score - 0.01 * len(model.drivers)


def choose(talk: Dialogue, table: Table, desk: Desk, found: Sequence[Found], model: Model | None) -> Parts:
    """Ask which parts the robot has; return them in the order in which files have them."""
    parts: Parts = {}
    for kind in KINDS:
        _answered(talk, parts, kind, [each for each in found if each.driver.kind == kind], model)
    for part in (*KINDS, *(() if model is None else model.drivers)):
        if part not in parts and (supposed := _supposed(talk, table, desk, part, model)) is not None:
            parts[part] = supposed
    _others(talk, table, parts)
    if "camera" in parts and desk.cameras:
        parts["camera"].section["source"] = min(desk.cameras, key=lambda each: isinstance(each.source, str)).source
    return {part: parts[part] for part in (*KINDS, *parts) if part in parts}


def _answered(talk: Dialogue, parts: Parts, kind: str, found: Sequence[Found], model: Model | None) -> None:
    """Ask for those of a kind that have answered: which is the robot's, and how one more is called."""
    chosen = _which(talk, kind, found, model)
    if chosen is None:
        return
    parts[kind] = _found_part(chosen, model)
    for each in found:
        if each is chosen:
            continue
        if KINDS[kind].several:
            _add(
                talk, parts, f"name {each.port.call}", each.driver, _found_part(each, None), at=f" at {each.port.call}"
            )
        else:
            talk.tell(f"a robot has one {kind}: {_title(each)} can be in a robot file of its own (mission robot new)")


def _which(talk: Dialogue, kind: str, found: Sequence[Found], model: Model | None) -> Found | None:
    """Ask which of those that have answered is the robot's; one that its model has, too, is proposed."""
    if not found:
        return None
    if len(found) == 1:
        key = f"take {found[0].port.call}"
        return found[0] if talk.confirm(key, f"take {_title(found[0])} for its {kind}?", default=True) else None
    named = {f"{each.driver.name} at {each.port.call}": each for each in found}
    usual = [name for name, each in named.items() if model is not None and model.drivers.get(kind) == each.driver]
    question = f"{len(found)} answer that could be its {kind}: which is it?"
    chosen = talk.choice(f"which {kind}", question, [*named, NONE], [*usual, *named][0])
    return named.get(chosen)


def _add(talk: Dialogue, parts: Parts, key: str, driver: Driver, part: Part, at: str = "") -> None:
    """Ask how one more part of a kind is called; missions say that name."""
    kind = driver.kind
    reserved, such = {each.word for each in declared(RobotKeys)} | set(KINDS), WRITTEN[kind]

    def check(answer: str) -> None:
        if answer == NONE:
            return
        if re.fullmatch(NAME, answer) is None:
            raise ValueError(f"'{answer:.40}' is no name: small letters, digits and _, beginning with a letter")
        if answer in parts or answer in reserved:
            raise ValueError(f"'{answer}' is taken: give another name, such as {such}")

    usual = next(name for number in count(2) if (name := f"{kind}{number}") not in parts)
    question = f"one more {kind}, {driver.name}{at}: what is it called, such as {such}? '{NONE}' leaves it out"
    name = talk.text(key, question, usual, check)
    if name != NONE:
        parts[name] = part


def _supposed(talk: Dialogue, table: Table, desk: Desk, part: str, model: Model | None) -> Part | None:
    """Ask for a part that was not found: one of the robot that it is like, or one that needs no port."""
    driver = None if model is None else model.drivers.get(part)
    if model is not None and driver is not None:
        question = f"has it the {part} of {model.name} ({driver.name})?"
        return Part(driver, model.section(part)) if talk.confirm(f"has {part}", question, default=True) else None
    usual = _usual(part, desk)
    if usual and talk.confirm(f"has {part}", f"has it a {part}?", default=usual != "page"):
        return Part(table.find(part, usual))
    return None


def _others(talk: Dialogue, table: Table, parts: Parts) -> None:
    """Ask for parts that do not say that they are there: by any driver, also one of another distribution."""
    free = [kind for kind, it in KINDS.items() if it.several or kind not in parts or parts[kind].port is None]
    names = {f"{kind}.{name}": (kind, name) for kind in free for name in table.names(kind)}

    def check(answer: str) -> None:
        for word in _words(answer):
            if word not in names:
                raise ValueError(f"'{word}' is none of: {', '.join(names)}")
            try:
                table.find(*names[word])
            except BrokenDriver as error:
                raise ValueError(f"'{word}' cannot be used: {error}") from error

    if not (talk.yes or talk.knows("others")):
        talk.tell("what there is a driver of:")
        for kind in free:
            talk.tell(f"  {kind}: {', '.join(f'{kind}.{name}' for name in table.names(kind))}")
    question = "what else has it? none, or some of these, with commas between them"
    for place, word in enumerate(_words(talk.text("others", question, NONE, check))):
        driver = table.find(*names[word])
        if driver.kind in parts and KINDS[driver.kind].several:
            _add(talk, parts, f"name {place} {word}", driver, Part(driver))
        else:
            parts[driver.kind] = Part(driver)


def _words(answer: str) -> list[str]:
    return [] if answer == NONE else [word.strip() for word in answer.split(",")]


def _title(found: Found) -> str:
    return f"{found.about or found.driver.about.rstrip('.')} at {found.port.path}"


def _found_part(each: Found, model: Model | None) -> Part:
    section: dict[str, Any] = {}
    same_servos = model is not None and model.fits(each)
    if model is not None and model.drivers.get(each.driver.kind) == each.driver:
        section = model.section(each.driver.kind)
        if each.units and not same_servos:
            section = {key: it for key, it in section.items() if key not in {"joints", "groups", "calibration"}}
    return Part(
        each.driver,
        {**dict.fromkeys(("port", *section)), **section, **each.keys, "port": each.port.call},  # the port first
        each.port,
        each.units,
    )


def _usual(kind: str, desk: Desk) -> str:
    """Return the driver of a part that a robot may have without a port; empty where nothing of it is plugged in."""
    there = {
        "camera": bool(desk.cameras),
        "microphone": any(card.hears for card in desk.sounds),
        "voice": True,
        "screen": True,
    }
    return KINDS[kind].usual if there.get(kind, False) else ""
