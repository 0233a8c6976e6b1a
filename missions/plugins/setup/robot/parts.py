"""Sections of a new robot's parts, from the keys that drivers declare."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import yaml

from config.section_reader import read_value
from drivers.api.driver import Driver
from drivers.api.keys import Key, declared_keys
from drivers.api.kinds import KINDS
from drivers.api.sections import SerialKeys
from drivers.finding.serial_ports import SerialPortInfo
from missions.plugins.schema.keys import bounds_text, format_default
from missions.plugins.setup.robot.dialogue import Dialogue

# Text of a robot file with comments, and the udev rules of its ports.

COMMENT_COLUMN = 30
"""Minimum column of comments in a new robot file."""

MAX_COMMENT_LENGTH = 70
"""Maximum length of a comment in a new robot file."""


def robot_text(name: str, summary: str, parts: Mapping[str, tuple[Driver, Mapping[str, Any]]]) -> str:
    """Return the text of a robot file; ``parts`` has the driver and the section of each part by its name."""
    lines = [
        "# Written by `mission robot new`, to be changed as you like; docs/robot_files.md has every key.",
        f"robot: {_quote_if_needed(name)}",
        f"summary: {_quote_if_needed(summary, '{}')}",
    ]
    for part, (driver, section) in parts.items():
        lines += ["", f"{part}:"] + ([f"  kind: {driver.kind}"] if part != driver.kind else [])
        lines += [f"  driver: {driver.name}  # {driver.about}"]
        helps = {key.word: key.help for key in declared_keys(driver.keys)}
        for word, value in section.items():
            lines += _entry_lines(word, value, helps.get(word, ""))
    return "\n".join(lines) + "\n"


def _entry_lines(word: str, value: Any, help_text: str) -> Iterator[str]:
    """Yield the lines of one key of a robot file, with its help as a comment.

    If all values in ``value`` are mappings or lists, as in ``joints``, each has a line of its own.
    """
    if isinstance(value, Mapping) and value and all(isinstance(each, Mapping | list) for each in value.values()):
        yield f"  {word}:"
        for name, inner in value.items():
            yield f"    {_quote_if_needed(name)}: {flow_text(inner)}"
        return
    line, comment = f"  {word}: {flow_text(value)}", help_text.partition(". ")[0].rstrip(".")
    yield f"{line.ljust(COMMENT_COLUMN)}  # {comment}" if comment and len(comment) <= MAX_COMMENT_LENGTH else line


def flow_text(value: Any) -> str:
    """Return a value as YAML on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_quote_if_needed(name)}: {flow_text(inner)}" for name, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(flow_text(inner) for inner in value) + "]"
    return _quote_if_needed(value) if isinstance(value, str) else json.dumps(value)


def _quote_if_needed(text: str, within: str = "[{}]") -> str:
    """Return a text as it must be written in YAML: in quotes if YAML would read it as something else.

    ``within`` is the YAML in which the text will stand, with ``{}`` in its place: by default a list.
    """
    try:
        read = yaml.safe_load(within.format(text))
        plain = read in (text, [text]) and yaml.safe_load(f"a: {text}") == {"a": text}
    except yaml.YAMLError:
        plain = False
    return text if plain else json.dumps(text, ensure_ascii=False)


def udev_rules(robot: str, ports: Mapping[str, SerialPortInfo]) -> str:
    """Return udev rules that give each USB port a stable name, access rights, and a short latency.

    ``ports`` are the ports by part; ports that are not on USB are left out.
    """
    rules = []
    for kind, port in ports.items():
        usb = port.usb
        if usb is None:
            continue
        ids = f'ATTRS{{idVendor}}=="{usb.vendor}", ATTRS{{idProduct}}=="{usb.product}"'
        own = f'ATTRS{{serial}}=="{usb.serial}"' if usb.serial else f'KERNELS=="{usb.socket}"'
        link = re.sub(r"\W", "_", f"{robot}_{kind}")
        rights = 'GROUP="dialout", MODE="0660", ENV{ID_MM_DEVICE_IGNORE}="1"'
        rules.append(f'SUBSYSTEM=="tty", {ids}, {own}, SYMLINK+="{link}", {rights}')
        if port.latency is not None and usb.serial:
            rules.append(f'ACTION=="add", SUBSYSTEM=="usb-serial", {own}, ATTR{{latency_timer}}="1"')
    return "".join(f"{rule}\n" for rule in [f"# The serial ports of {robot}.", *rules]) if rules else ""


ONE_LINE_FORMS = {"text", "choice", "flag", "number", "integer", "quantity", "span", "vector"}
"""Forms of keys in a robot file, such as a number, whose values fit on one line."""

SEPARATE_KEYS = {"port", "baud", "joints", "groups", "source"}
"""Keys of a part's section whose values the dialogue asks for in other questions."""


@dataclass(slots=True)
class RobotPart:
    """A part of the new robot: driver, section, and port."""

    driver: Driver
    section: dict[str, Any] = field(default_factory=dict)
    port: SerialPortInfo | None = None
    units: tuple[tuple[int, str, str], ...] = ()


def ask_figures(talk: Dialogue, kind: str, part: RobotPart) -> None:
    """Ask for the required values of a part's section, such as sizes, and for optional ones if the user wants to."""
    cls = part.driver.keys
    if issubclass(cls, SerialKeys) and "port" not in part.section:
        port = next(key for key in declared_keys(cls) if key.word == "port")
        part.section = {"port": _ask_key(talk, kind, port, "/dev/ttyUSB0"), **part.section}
        for key in declared_keys(cls):
            if key.word == "baud" and not key.required:
                _ask_optional(talk, kind, key, part.section)
    _ask_required(talk, kind, cls, part.section)
    if kind == "camera":
        for key in declared_keys(cls):
            if key.word in {"source", "position", "field_of_view"}:
                _ask_optional(talk, kind, key, part.section)
    if not KINDS[part.driver.kind].has_port:
        return
    words = [
        key
        for key in declared_keys(cls)
        if not key.required and key.form in ONE_LINE_FORMS and key.word not in SEPARATE_KEYS
    ]
    names = ", ".join(key.word for key in words[:4])
    if words and talk.ask_yes_no(f"{kind}?", f"set other values of the {kind}, such as {names}?", default=False):
        for key in words:
            _ask_optional(talk, kind, key, part.section)


def _ask_required(talk: Dialogue, at: str, cls: type, section: dict[str, Any]) -> None:
    for key in declared_keys(cls):
        if not key.required or key.word in SEPARATE_KEYS:
            continue
        if key.form == "section" and key.of is not None:
            section[key.word] = dict(section.get(key.word, {}))
            _ask_required(talk, f"{at}.{key.word}", key.of, section[key.word])
        elif key.word not in section:
            section[key.word] = _ask_key(talk, at, key, None)


def _ask_optional(talk: Dialogue, at: str, key: Key, section: dict[str, Any]) -> None:
    usual = format_default(key)
    found = _ask_key(talk, at, key, flow_text(section[key.word]) if key.word in section else usual)
    if found is not None and (key.word in section or flow_text(found) != usual):
        section[key.word] = found


def _ask_key(talk: Dialogue, at: str, key: Key, default: str | None) -> Any:
    bounds = bounds_text(key)
    question = f"{at} {key.word}: {key.help}" + (f" {bounds}" if bounds else "")

    def check(answer: str) -> None:
        if answer or default is None:
            read_value(key, answer)

    return yaml.safe_load(talk.ask_text(f"{at}.{key.word}", question, default, check))
