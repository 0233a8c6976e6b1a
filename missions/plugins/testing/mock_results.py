"""Results of mocks: values of a test file with the type of the mocked behaviour's output."""

from collections.abc import Mapping as Named
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any

from config.diagnostics import suggest_from
from config.fields import Fields, value_of
from config.units import UNITS, DimensionError, Quantity, common_dimension, parse_quantity, quoted_value, si_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from missions.language.kinds import (
    FLAG,
    NOTHING,
    TEXT,
    UNSETTLED,
    Kind,
    ListKind,
    RecordKind,
    describe_kind,
    is_numeric,
    kind_of_value,
    member_kinds,
    members_of,
)
from missions.language.lists import default_value
from perception.api import Box, Percept

INVALID_RESULT = object()
"""Placeholder for a result with an error that has been reported."""

MADE_MEMBERS = frozenset({"stamp", "box"})
"""Members of a percept that a test file cannot set: the time of the picture, and the box around the percept in it."""

PERCEPT_MEMBERS: Named[str, object] = {"id": 1, "distance": 1.5, "box": Box(300.0, 220.0, 40.0, 40.0)}
"""Values of members of a percept that a test file omits; other omitted numbers are 0, omitted texts empty."""


@dataclass(frozen=True, slots=True)
class ResultReader:
    """Reads the result of a mock as plain values, in SI units; errors are added to ``fields``.

    In the results of a mission, ``null`` is allowed too, because a variable of a mission can have no value.
    """

    fields: Fields

    def read(self, node: Node, kind: Kind, label: str) -> object:
        """Return the value in ``node`` if it has the ``kind``; ``label`` names it in errors."""
        before = len(self.fields.diagnostics)
        found = self._read(node, kind, label)
        if len(self.fields.diagnostics) == before:
            try:
                make_result(kind, found, 0.0)
            except Exception as error:  # a class of the user's own may refuse the values
                self.fields.add_error(node.mark, f"{label} cannot be made: {error}")
        return found if len(self.fields.diagnostics) == before else INVALID_RESULT

    def _read(self, node: Node, kind: Kind, label: str) -> object:
        match kind:
            case ListKind(member_kind=inner):
                if isinstance(node, Listing):
                    return [
                        self._read(item, inner, f"member {number} of {label}")
                        for number, item in enumerate(node.items, start=1)
                    ]
                example = node.text if isinstance(node, Scalar) and node.text else "..."
                return self._reject(node, f"{label} needs a list", f"put it in brackets: [{example}]")
            case RecordKind():
                return self._read_record(node, kind, label)
            case None | "unsettled" | "nothing":
                return plain_data(node)
        return self._read_scalar(node, str(kind), label)

    def _read_record(self, node: Node, kind: RecordKind, label: str) -> object:
        names = None if kind.other_kind is not None else settable_members(kind)
        if not isinstance(node, Mapping):
            example = f"{{{next(iter(names), 'name')}: ...}}" if names is not None else "{name: ...}"
            return self._reject(node, f"{label} needs names and values, such as {example}")
        found: dict[str, object] = {}
        for name, value in node.entries:
            if names is not None and name.text not in names:
                self.fields.add_error(
                    name.mark, f"{label} has no {quoted_value(name.text)}", suggest_from(name.text, names)
                )
            elif kind.declared_type is None and isinstance(value, Scalar) and value.value is None:
                found[name.text] = None
            else:
                found[name.text] = self._read(value, kind.member(name.text), f"'{name.text}'")
        return found

    def _read_scalar(self, node: Node, kind: str, label: str) -> object:
        if isinstance(node, Scalar) and kind in UNITS:
            try:
                return Quantity(si_value(node.text if node.quoted else value_of(node), kind), kind)
            except ValueError as error:
                self.fields.add_error(node.mark, f"{label} {error}")
                return INVALID_RESULT
        if not isinstance(node, Scalar) or node.value is None:
            return self._reject(node, f"{label} needs {describe_kind(kind)}")
        if kind == TEXT:
            return node.text
        found = parse_quantity(node.text) or node.value
        return found if has_kind(found, kind) else self._reject(node, f"{label} needs {describe_kind(kind)}")

    def _reject(self, node: Node, message: str, hint: str = "") -> object:
        form = "a list" if isinstance(node, Listing) else "a mapping"
        got = quoted_value(value_of(node)) if isinstance(node, Scalar) else form
        self.fields.add_error(node.mark, f"{message}, got {got}", hint)
        return INVALID_RESULT


def has_kind(value: object, kind: str) -> bool:
    """Return whether a plain value has the type ``kind``: a flag, or a number of this dimension."""
    found = kind_of_value(value)
    if not is_numeric(found) or not is_numeric(kind):
        return found == kind == FLAG
    try:
        return bool(common_dimension(str(found), kind))
    except DimensionError:
        return False


def plain_data(node: Node) -> object:
    """Return a node of a test file as plain lists, dicts and values."""
    if isinstance(node, Listing):
        return [plain_data(item) for item in node.items]
    if isinstance(node, Mapping):
        return {key.text: plain_data(value) for key, value in node.entries}
    return default_value(node)


def settable_members(kind: RecordKind) -> list[str]:
    """Return the members of a record that a test file can set."""
    declared = kind.declared_type
    if declared is None:
        return sorted(kind.members)
    if not is_dataclass(declared):
        return sorted({*member_kinds(declared), *members_of(declared)})
    made = MADE_MEMBERS if issubclass(declared, Percept) else frozenset()
    return [each.name for each in fields(declared) if each.init and each.name not in made]


def make_result(kind: Kind, value: object, now: float) -> object:
    """Return the output of a mocked behaviour from the plain values of a test file.

    A percept is seen ``now``, in seconds on the clock of the run.
    """
    if value is None:
        return None
    match kind:
        case ListKind(member_kind=inner) if isinstance(value, list):
            return [make_result(inner, each, now) for each in value]
        case RecordKind(declared_type=declared) if isinstance(value, dict):
            if declared is not None and is_dataclass(declared):
                return _make_record(declared, value, now)
            return {name: make_result(kind.member(name), each, now) for name, each in value.items()}
    return value


def _make_record(cls: Any, given: Named[str, object], now: float) -> object:
    """Return an object of a dataclass; its members are plain numbers in SI units, as those of a real output."""
    defaults = {**PERCEPT_MEMBERS, "stamp": now} if issubclass(cls, Percept) else {}
    kinds, values = member_kinds(cls), {}
    for each in fields(cls):
        if each.name in given:
            made = make_result(kinds.get(each.name), given[each.name], now)
            values[each.name] = float(made) if isinstance(made, Quantity) else made
        elif each.name in defaults:
            values[each.name] = defaults[each.name]
        elif each.init and each.default is MISSING and each.default_factory is MISSING:
            values[each.name] = _blank(kinds.get(each.name), now)
    return cls(**values)


def _blank(kind: Kind, now: float) -> object:
    """Return the value of a member that a test file leaves out and that has no default."""
    if isinstance(kind, ListKind):
        return []
    if isinstance(kind, RecordKind):
        return make_result(kind, {}, now)
    blanks: dict[str, object] = {TEXT: "", FLAG: False}
    return None if kind in (None, NOTHING, UNSETTLED) else blanks.get(kind, 0)
