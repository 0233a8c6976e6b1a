"""A mission's params: their names, kinds and defaults, and the values that a caller gives them."""

import math
from collections.abc import Mapping as Named
from dataclasses import dataclass, replace

from behaviours.leaf import REQUIRED, Argument
from config.faults import Fault, Mark, Source, note, one_of
from config.marked import Mapping, Node, Scalar, plain
from config.units import UNITS, Quantity, quantity, seen
from missions.language.arguments import converter, default_value, read_argument
from missions.language.notes import Notes
from missions.language.values import Convert

TYPES = (*UNITS, "text", "number", "count", "flag")
"""What the ``type`` of a param in its long form may be."""

KEYS = ("default", "type", "help", "low", "high")
"""The keys of a param in its long form."""


@dataclass(frozen=True, slots=True)
class Param:
    """One param: an argument of the mission. ``default`` is REQUIRED for one that the caller must give."""

    name: str
    default: object
    help: str
    convert: Convert
    kind: str

    @property
    def required(self) -> bool:
        """True when the caller must give it."""
        return self.default is REQUIRED

    def take(self, text: str) -> object:
        """Read a value from a command line. Raises ValueError that says what was expected."""
        if self.kind == "text":
            return self.convert(text)
        value = plain(text)
        found = quantity(text)
        return self.convert(value if found is None else found)


def read_params(notes: Notes, node: Node | None) -> dict[str, Param]:
    """Read the ``params`` of a mission: ``name: default``, or ``name: {default, type, help, low, high}``."""
    if node is not None and not isinstance(node, Mapping):
        notes.fault(node.mark, "'params' needs names and their defaults", "write 'patience: 60 s' under it")
    found: dict[str, Param] = {}
    for key, value in node.entries if isinstance(node, Mapping) else ():
        notes.new_name(key, "a param")
        param = _long(notes, key, value) if isinstance(value, Mapping) else _short(notes, key, value)
        if param is not None:
            found[key.text] = param
    return found


def _short(notes: Notes, key: Scalar, value: Node) -> Param | None:
    if not isinstance(value, Scalar):
        notes.fault(value.mark, f"param '{key.text}' needs one value as its default")
        return None
    if "${" in value.text:
        notes.fault(value.mark, f"the default of param '{key.text}' cannot be calculated", "write a plain value")
        return None
    default = default_value(value)
    argument = Argument(key.text, _kind(default), "")
    return Param(key.text, default, "", _keeping(notes, argument), argument.kind)


def _long(notes: Notes, key: Scalar, node: Mapping) -> Param | None:
    what = f"param '{key.text}'"
    for name, _ in node.entries:
        if name.text not in KEYS:
            notes.fault(name.mark, f"{what} has no key '{name.text}'", one_of(name.text, KEYS))
    given, typed, text = node.get("default"), node.get("type"), node.get("help")
    kind = typed.text if isinstance(typed, Scalar) else None
    if typed is not None and kind not in TYPES:
        notes.fault(typed.mark, f"{what}: unknown type {seen(kind)}", one_of(kind or "", TYPES))
        return None
    if kind is None and given is None:
        notes.fault(node.mark, f"{what} needs a default, or a type", "write {type: text} or {default: 60 s}")
        return None
    if kind is None:
        kind = _kind(default_value(given)) if isinstance(given, Scalar) else "value"
    argument = Argument(key.text, kind, text.text if isinstance(text, Scalar) else "")
    bounds = {
        side: read_argument(notes, argument, bound, f"{what}: '{side}'").constant
        for side in ("low", "high")
        if (bound := node.get(side)) is not None
    }
    numbers = {side: bound for side, bound in bounds.items() if isinstance(bound, int | float)}
    low, high = numbers.get("low", -math.inf), numbers.get("high", math.inf)
    argument = replace(argument, low=low, high=high)
    convert = _keeping(notes, argument)
    default: object = REQUIRED
    if isinstance(given, Scalar) and "${" not in given.text:
        default = notes.constant(given, given.text if kind == "text" else default_value(given), what, convert).constant
    elif given is not None:
        notes.fault(given.mark, f"the default of {what} must be one plain value")
    return Param(key.text, default, argument.help, convert, kind)


def _kind(default: object) -> str:
    if isinstance(default, Quantity):
        return default.dimension
    if isinstance(default, bool):
        return "flag"
    if isinstance(default, int | float):
        return "number"
    return "text" if isinstance(default, str) else "value"


def _keeping(notes: Notes, argument: Argument) -> Convert:
    """Check as an argument is checked, but keep quantities and whole numbers as they are written."""
    check = converter(notes, argument)

    def convert(value: object) -> object:
        checked = check(value)
        as_written = isinstance(value, Quantity) or (isinstance(value, int) and not isinstance(value, bool))
        return value if as_written and argument.kind != "text" else checked

    return convert


def take_params(
    notes: Notes, params: Named[str, Param], given: Named[str, str], mission: str, *, complete: bool
) -> None:
    """Put the caller's values in the place of the defaults; where ``complete``, note what is still missing."""
    for name, param in params.items():
        if not param.required:
            notes.params[name] = param.default
        elif name not in given:
            notes.stored.add(name)
            notes.awaited.add(name)
            if complete:
                source = Source("--param", "")
                hint = f'--param {name}="..."' + (f"  ({param.help})" if param.help else "")
                note(notes.faults, Fault(source, Mark(), f"mission '{mission}' needs '{name}', a {param.kind}", hint))
    for name, text in given.items():
        source = Source(f"--param {name}", f"{name}={text}")
        if name not in params:
            hint = one_of(name, params) or "it has none"
            message = f"mission '{mission}' has no param {seen(name)}"
            note(notes.faults, Fault(source, Mark(1, 1, len(name)), message, hint))
            continue
        try:
            notes.params[name] = params[name].take(text)
        except ValueError as error:
            note(notes.faults, Fault(source, Mark(1, len(name) + 2, max(1, len(text))), f"'{name}' {error}"))
