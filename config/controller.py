"""Controller files: the rule bases of a controller as plain values in SI units, and the numbers in them to tune."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from config import marked
from config.declared import read_keys
from config.faults import InvalidFileError, Mark, Source
from config.fields import Fields, fields_of
from config.marked import Listing, Node, Scalar, compose, read_source
from config.units import quantity
from drivers.api.keys import key, keys

ABOUT = ("controller", "summary")
"""The keys that say what a file is; the others are what its rules are made of."""

FIXED = "most"
"""The one number of a rule base that is a limit, and not to be tuned."""

_WRITTEN = re.compile(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\S*)")


@keys
class ControllerKeys:
    """The keys of a controller file."""

    controller: str = key(help="What it is called.")
    summary: str = key(default="", help="What it is, in a line.")
    bases: Mapping[str, object] = key(rest=True, help="A rule base: its variables, their sets, and its rules.")


@dataclass(frozen=True, slots=True)
class ControllerConfig:
    """A controller: its rule bases by name as plain values, every quantity an SI float, every rule as written."""

    name: str
    summary: str
    values: dict[str, object]


@dataclass(frozen=True, slots=True)
class Figure:
    """A number in a controller file: under which keys and at which ``mark`` it stands, in the unit written there."""

    keys: tuple[str, ...]
    mark: Mark
    number: float
    unit: str


def load_controller(path: Path) -> ControllerConfig:
    """Read a controller file. Raises InvalidFileError when it is none; what its rules mean, the controller checks."""
    return parse_controller(read_source(path))


def parse_controller(source: Source) -> ControllerConfig:
    """Read the text of a controller file. Raises as ``load_controller``."""
    fields = fields_of(source, what="a controller file")
    told = read_keys(fields, ControllerKeys)
    values = {key.text: _plain(node) for key, node in fields.entries() if key.text not in ABOUT}
    _check_tables(fields, fields.node)
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return ControllerConfig(told.controller, told.summary, values)


def figures(source: Source) -> list[Figure]:
    """Return the numbers of the rule bases, each once. Raises InvalidFileError for a file that cannot be read."""
    found: dict[Mark, Figure] = {}
    for figure in _figures(compose(source), ()):
        found.setdefault(figure.mark, figure)  # what an alias repeats stands where it was written first
    return list(found.values())


def rewritten(source: Source, changes: Mapping[Mark, str]) -> str:
    """Return the text of a file with other words at some marks; all else stays as it is, comments too."""
    lines = source.text.splitlines(keepends=True)
    for mark, word in sorted(changes.items(), reverse=True):
        line, start = lines[mark.line - 1], mark.column - 1
        lines[mark.line - 1] = line[:start] + word + line[start + mark.length :]
    return "".join(lines)


def renamed(source: Source, name: str, summary: str) -> dict[Mark, str]:
    """Return the changes that give the controller of a file another name and summary, where they fill no more lines."""
    top, changes = compose(source), dict[Mark, str]()
    for word, text in zip(ABOUT, (name, summary), strict=True):
        node = top.get(word) if isinstance(top, marked.Mapping) else None
        if isinstance(node, Scalar) and node.mark.length >= len(node.text):
            changes[node.mark] = json.dumps(text, ensure_ascii=False)  # a text in quotes is the same in YAML
    return changes


def _figures(node: Node, keys: tuple[str, ...]) -> Iterator[Figure]:
    if isinstance(node, marked.Mapping):
        for key, value in node.entries:
            if (keys or key.text not in ABOUT) and key.text not in ("rules", FIXED):
                yield from _figures(value, (*keys, key.text))
    elif isinstance(node, Listing):
        for item in node.items:
            yield from _figures(item, keys)
    elif (found := _WRITTEN.fullmatch(node.text.strip())) and not node.quoted:
        yield Figure(keys, node.mark, float(found[1]), found[2])


def _plain(node: Node) -> object:
    if isinstance(node, Listing):
        return [_plain(item) for item in node.items]
    if isinstance(node, marked.Mapping):
        return {key.text: _plain(value) for key, value in node.entries}
    measured = quantity(node.text)
    return node.value if measured is None else float(measured)


def _check_tables(fields: Fields, node: Node) -> None:
    """Note every row of a rule table that is longer or shorter than the table's first row, which names the columns."""
    if not isinstance(node, marked.Mapping):
        return
    for name, value in node.entries:
        if name.text == "rules" and isinstance(value, marked.Mapping):
            _check_rows(fields, value)
        elif not isinstance(value, Scalar):
            _check_tables(fields, value)


def _check_rows(fields: Fields, table: marked.Mapping) -> None:
    columns = 0
    for place, (name, row) in enumerate(table.entries):
        if not isinstance(row, Listing):
            fields.fault(row.mark, f"row '{name.text}' needs a list: [one conclusion for each column]")
        elif place == 0:
            columns = len(row.items)
        elif len(row.items) != columns and columns:
            fields.fault(name.mark, f"row '{name.text}' has {len(row.items)} conclusions for {columns} columns")
