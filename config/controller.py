"""Controller files: the rule bases of a controller as plain values in SI units, and the numbers in them to tune."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Literal

from config import yaml_nodes
from config.diagnostics import InvalidFileError, Mark, SourceText
from config.fields import fields_of
from config.section_reader import read_keys
from config.units import parse_quantity
from config.yaml_nodes import Listing, Node, Scalar, compose, read_source
from drivers.api.fast_dataclass import dataclass
from drivers.api.keys import KeyDiagnostic, inside, key, keys

DESCRIPTION_KEYS = ("controller", "summary")
"""The keys that say what a file is; the others are what its rules are made of."""

LIMIT_KEY = "most"
"""The one number of a rule base that is a limit, and not to be tuned."""

_WRITTEN = re.compile(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\S*)")


Row = Annotated[tuple[str, ...], inside(wrong="row '{}' needs a list: [one conclusion for each column]")]


@keys
class RuleBaseKeys:
    """A rule base: rules in words, or ``p`` and ``d``. What they mean, the controller checks."""

    inputs: Mapping[str, Mapping[str, object]] = key(
        default={}, help="What it listens to, each with its terms: `{error: {left: 6 deg, ahead: 0 deg}}`."
    )
    output: Mapping[str, Mapping[str, object]] = key(default={}, help="What it turns, with the terms of that.")
    rules: tuple[str, ...] | Mapping[str, Row] = key(
        default=(), help="Sentences; or a table, whose first row names two inputs and heads the columns."
    )
    method: Literal["sugeno", "mamdani"] = key(
        default="sugeno",
        help="How one number comes of the conclusions: terms of the output are numbers, or fuzzy sets.",
    )
    joined: Literal["product", "min"] | None = key(
        default=None, word="and", help="How conditions are joined; else `product` for `sugeno`, `min` for `mamdani`."
    )
    p: float | None = key(
        default=None, low=0.0, help="In the place of rules: how much of the error it turns by, in 1/s."
    )
    d: float | None = key(default=None, low=0.0, help="With `p`: how much of the error's rate.")
    most: object = key(default=None, help="With `p`: the most that it turns by, such as `120 deg/s`.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield every row of a table that is longer or shorter than its first one, which names the columns."""
        table = self.rules if isinstance(self.rules, Mapping) else {}
        columns = len(next(iter(table.values()), ()))
        for name, row in table.items():
            if columns and len(row) != columns:
                at = ("rules", name)
                message = f"row '{name}' has {len(row)} conclusions for {columns} columns"
                yield KeyDiagnostic(message, at, marks_key=True, about=(at,))


@keys
class ControllerFileKeys:
    """The keys of a controller file."""

    controller: str = key(help="What it is called.")
    summary: str = key(default="", help="What it is, in a line.")
    predict: bool = key(default=True, help="Whether it goes by where the target will be, or by the newest picture.")
    pan: RuleBaseKeys | None = key(default=None, help="The rules by which a head turns.")
    tilt: RuleBaseKeys | None = key(default=None, help="Those by which it looks up and down.")
    base: RuleBaseKeys | None = key(default=None, help="Those by which a base turns that has a head.")
    turn: RuleBaseKeys | None = key(default=None, help="Those by which a base without a head turns.")


@dataclass(frozen=True, slots=True)
class ControllerConfig:
    """A controller: its rule bases by name as plain values, every quantity an SI float, every rule as written."""

    name: str
    summary: str
    values: dict[str, object]


@dataclass(frozen=True, slots=True)
class TunableNumber:
    """A number in a controller file: under which keys and at which ``mark`` it stands, in the unit written there."""

    keys: tuple[str, ...]
    mark: Mark
    number: float
    unit: str


def load_controller(path: Path) -> ControllerConfig:
    """Read a controller file. Raises InvalidFileError when it is none; what its rules mean, the controller checks."""
    return parse_controller(read_source(path))


def parse_controller(source: SourceText) -> ControllerConfig:
    """Read the text of a controller file. Raises as ``load_controller``."""
    fields = fields_of(source, subject="a controller file")
    told = read_keys(fields, ControllerFileKeys)
    values = {key.text: _plain(node) for key, node in fields.entries() if key.text not in DESCRIPTION_KEYS}
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return ControllerConfig(told.controller, told.summary, values)


def tunable_numbers(source: SourceText) -> list[TunableNumber]:
    """Return the numbers of the rule bases, each once. Raises InvalidFileError for a file that cannot be read."""
    found: dict[Mark, TunableNumber] = {}
    for figure in _tunable_numbers(compose(source), ()):
        found.setdefault(figure.mark, figure)  # what an alias repeats stands where it was written first
    return list(found.values())


def replace_words(source: SourceText, changes: Mapping[Mark, str]) -> str:
    """Return the text of a file with other words at some marks; all else stays as it is, comments too."""
    lines = source.text.splitlines(keepends=True)
    for mark, word in sorted(changes.items(), reverse=True):
        line, start = lines[mark.line - 1], mark.column - 1
        lines[mark.line - 1] = line[:start] + word + line[start + mark.length :]
    return "".join(lines)


def name_changes(source: SourceText, name: str, summary: str) -> dict[Mark, str]:
    """Return the changes that give the controller of a file another name and summary, where they fill no more lines."""
    top, changes = compose(source), dict[Mark, str]()
    for word, text in zip(DESCRIPTION_KEYS, (name, summary), strict=True):
        node = top.get(word) if isinstance(top, yaml_nodes.Mapping) else None
        if isinstance(node, Scalar) and node.mark.length >= len(node.text):
            changes[node.mark] = json.dumps(text, ensure_ascii=False)  # a text in quotes is the same in YAML
    return changes


def _tunable_numbers(node: Node, keys: tuple[str, ...]) -> Iterator[TunableNumber]:
    if isinstance(node, yaml_nodes.Mapping):
        for key, value in node.entries:
            if (keys or key.text not in DESCRIPTION_KEYS) and key.text not in ("rules", LIMIT_KEY):
                yield from _tunable_numbers(value, (*keys, key.text))
    elif isinstance(node, Listing):
        for item in node.items:
            yield from _tunable_numbers(item, keys)
    elif (found := _WRITTEN.fullmatch(node.text.strip())) and not node.quoted:
        yield TunableNumber(keys, node.mark, float(found[1]), found[2])


def _plain(node: Node) -> object:
    if isinstance(node, Listing):
        return [_plain(item) for item in node.items]
    if isinstance(node, yaml_nodes.Mapping):
        return {key.text: _plain(value) for key, value in node.entries}
    measured = parse_quantity(node.text)
    return node.value if measured is None else float(measured)
