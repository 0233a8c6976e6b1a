"""Which parts a new robot has, and what their sections say: asked by the keys that drivers declare."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import yaml

from config.declared import read_value
from config.defaults import own_files
from config.faults import InvalidFileError
from config.library import find, shipped
from drivers.api.driver import Driver
from drivers.api.keys import Key, declared
from drivers.api.kinds import KINDS, WIRED
from drivers.api.sections import Wired
from drivers.finding.serial_ports import SerialPort
from drivers.finding.survey import Desk
from missions.cli.robot.desk import Found
from missions.cli.robot.dialogue import Dialogue
from missions.cli.robot.writing import flow
from missions.library.drivers import Table, load_robot
from missions.schema.keys import bounds_told, shown_default

NONE = "none"

PLAIN = {"text", "choice", "flag", "number", "integer", "quantity", "span", "vector"}
"""Forms of keys that are typed on one line."""

APART = {"port", "baud", "joints", "groups", "source"}
"""Keys that are found out otherwise."""


@dataclass(slots=True)
class Part:
    """A part of the new robot: its driver, what its section says, and where it is plugged in."""

    driver: Driver
    section: dict[str, Any] = field(default_factory=dict)
    port: SerialPort | None = None
    units: tuple[tuple[int, str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Model:
    """A robot that the new one is like: the drivers of its parts, and what its file says of each."""

    name: str
    drivers: Mapping[str, Driver]
    sections: Mapping[str, dict[str, Any]]

    def ids(self) -> set[int]:
        """The IDs of its servos."""
        joints = self.sections.get("arm", {}).get("joints", {})
        return {joint["id"] for joint in joints.values() if isinstance(joint, dict) and "id" in joint}


def like(talk: Dialogue, found: Sequence[Found]) -> Model | None:
    """Ask which known robot the new one is like; the one that shares most with what is plugged in is proposed."""
    models = [model for name in (shipped("robots") | own_files("robots")) if (model := _model(name)) is not None]
    fitting = sorted(models, key=partial(_likeness, found), reverse=True)
    best = fitting[0].name if fitting and _likeness(found, fitting[0]) > 0 else NONE
    question = "which of these is it like? its names, limits and figures are taken over"
    chosen = talk.choice("like", question, [NONE, *(model.name for model in fitting)], best)
    return next((model for model in fitting if model.name == chosen), None)


def _model(name: str) -> Model | None:
    path = find("robots", name)
    try:
        config = load_robot(path)
    except InvalidFileError:
        return None
    raw = yaml.safe_load(path.read_text(encoding="utf-8"))
    drivers = {kind: section.driver for kind, section in config.sections.items()}
    return Model(name, drivers, {kind: {**raw[kind]} for kind in drivers})


def _likeness(found: Sequence[Found], model: Model) -> float:
    """Return how much a robot has of what is plugged in; servos count where their IDs are the same."""
    score = 0.0
    for each in found:
        if model.drivers.get(each.driver.kind) == each.driver:
            score += 1.0
            if each.units:
                score += 2.0 if {unit[0] for unit in each.units} == model.ids() else -1.0
    return score - 0.01 * len(model.drivers)


def choose(talk: Dialogue, table: Table, desk: Desk, found: Sequence[Found], model: Model | None) -> dict[str, Part]:
    """Ask which parts the robot has; return them in the order in which files have them."""
    parts: dict[str, Part] = {}
    for each in found:
        kind = each.driver.kind
        if kind in parts:
            talk.tell(f"a second {kind}, {each.about} at {each.port.call}, is left out")
        elif talk.confirm(f"take {each.port.call}", f"take {_title(each)} for its {kind}?", default=True):
            parts[kind] = _found_part(each, model)
    for kind in KINDS:
        if kind not in parts and (part := _supposed(talk, table, desk, kind, model)) is not None:
            parts[kind] = part
    _others(talk, table, parts)
    if "camera" in parts and desk.cameras:
        parts["camera"].section["source"] = int(desk.cameras[0].path.removeprefix("/dev/video"))
    return {kind: parts[kind] for kind in KINDS if kind in parts}


def _supposed(talk: Dialogue, table: Table, desk: Desk, kind: str, model: Model | None) -> Part | None:
    """Ask for a part that was not found: one of the robot that it is like, or one that needs no port."""
    driver = None if model is None else model.drivers.get(kind)
    if model is not None and driver is not None:
        question = f"has it the {kind} of {model.name} ({driver.name})?"
        section = {key: it for key, it in model.sections[kind].items() if key != "driver"}
        return Part(driver, section) if talk.confirm(f"has {kind}", question, default=True) else None
    usual = _usual(kind, desk)
    if usual and talk.confirm(f"has {kind}", f"has it a {kind}?", default=usual != "page"):
        return Part(table.find(kind, usual))
    return None


def _others(talk: Dialogue, table: Table, parts: dict[str, Part]) -> None:
    """Ask for parts that do not say that they are there."""
    names = [f"{kind}.{name}" for kind in WIRED if kind not in parts for name in table.names(kind)]

    def check(answer: str) -> None:
        for word in _words(answer):
            if word not in names:
                raise ValueError(f"'{word}' is none of: {', '.join(names)}")

    if not names:
        return
    question = f"what else has it? {NONE}, or some of {', '.join(names)}"
    for word in _words(talk.text("others", question, NONE, check)):
        kind, _, name = word.partition(".")
        parts.setdefault(kind, Part(table.find(kind, name)))


def _words(answer: str) -> list[str]:
    return [] if answer == NONE else [word.strip() for word in answer.split(",")]


def _title(found: Found) -> str:
    return f"{found.about or found.driver.about.rstrip('.')} at {found.port.path}"


def _found_part(each: Found, model: Model | None) -> Part:
    section: dict[str, Any] = {}
    same_servos = model is not None and {unit[0] for unit in each.units} == model.ids()
    if model is not None and model.drivers.get(each.driver.kind) == each.driver:
        section = {key: it for key, it in model.sections[each.driver.kind].items() if key != "driver"}
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


def figures(talk: Dialogue, kind: str, part: Part) -> None:
    """Ask for what a section must say, and, where it is wished, for what it may."""
    cls = part.driver.keys
    if issubclass(cls, Wired) and "port" not in part.section:
        port = next(key for key in declared(cls) if key.word == "port")
        part.section = {"port": _ask(talk, kind, port, "/dev/ttyUSB0"), **part.section}
    _required(talk, kind, cls, part.section)
    if kind == "camera":
        for key in declared(cls):
            if key.word in {"source", "position", "field_of_view"}:
                _optional(talk, kind, key, part.section)
    if not KINDS[kind].wired:
        return
    words = [key for key in declared(cls) if not key.required and key.form in PLAIN and key.word not in APART]
    names = ", ".join(key.word for key in words[:4])
    if words and talk.confirm(f"{kind}?", f"other figures of the {kind}, such as {names}?", default=False):
        for key in words:
            _optional(talk, kind, key, part.section)


def _required(talk: Dialogue, at: str, cls: type, section: dict[str, Any]) -> None:
    for key in declared(cls):
        if not key.required or key.word in APART:
            continue
        if key.form == "section" and key.of is not None:
            section[key.word] = dict(section.get(key.word, {}))
            _required(talk, f"{at}.{key.word}", key.of, section[key.word])
        elif key.word not in section:
            section[key.word] = _ask(talk, at, key, None)


def _optional(talk: Dialogue, at: str, key: Key, section: dict[str, Any]) -> None:
    usual = shown_default(key)
    found = _ask(talk, at, key, flow(section[key.word]) if key.word in section else usual)
    if found is not None and (key.word in section or flow(found) != usual):
        section[key.word] = found


def _ask(talk: Dialogue, at: str, key: Key, default: str | None) -> Any:
    bounds = bounds_told(key)
    question = f"{at} {key.word}: {key.help}" + (f" {bounds}" if bounds else "")

    def check(answer: str) -> None:
        if answer or default is None:
            read_value(key, answer)

    return yaml.safe_load(talk.text(f"{at}.{key.word}", question, default, check))
