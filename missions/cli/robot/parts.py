"""What the sections of a new robot's parts say: asked by the keys that drivers declare."""

from dataclasses import dataclass, field
from typing import Any

import yaml

from config.declared import read_value
from drivers.api.driver import Driver
from drivers.api.keys import Key, declared
from drivers.api.kinds import KINDS
from drivers.api.sections import Wired
from drivers.finding.serial_ports import SerialPort
from missions.cli.robot.dialogue import Dialogue
from missions.cli.robot.writing import flow
from missions.schema.keys import bounds_told, shown_default

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


def figures(talk: Dialogue, kind: str, part: Part) -> None:
    """Ask for what the section of a part, by its name, must say, and, where it is wished, for what it may."""
    cls = part.driver.keys
    if issubclass(cls, Wired) and "port" not in part.section:
        port = next(key for key in declared(cls) if key.word == "port")
        part.section = {"port": _ask(talk, kind, port, "/dev/ttyUSB0"), **part.section}
    _required(talk, kind, cls, part.section)
    if kind == "camera":
        for key in declared(cls):
            if key.word in {"source", "position", "field_of_view"}:
                _optional(talk, kind, key, part.section)
    if not KINDS[part.driver.kind].wired:
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
