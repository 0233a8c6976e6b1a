"""Controller files: fuzzy or PD rule bases as plain values in SI units, and the tunable numbers in them."""

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
"""Keys that describe a controller file; its other keys hold the rules."""

LIMIT_KEY = "most"
"""Key of a PD rule base whose number is a limit, so that tuning leaves it unchanged."""

_WRITTEN = re.compile(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\S*)")


Row = Annotated[tuple[str, ...], inside(wrong="row '{}' needs a list: [one conclusion for each column]")]


@keys
class RuleBaseKeys:
    """Keys of one rule base in a controller file.

    A fuzzy controller has ``inputs``, ``output`` and ``rules``; a PD controller has the gains ``p`` and ``d`` instead.
    Whether the values make sense is checked when the controller is created.
    """

    inputs: Mapping[str, Mapping[str, object]] = key(
        default={}, help="Inputs, each with its terms: `{error: {left: 6 deg, ahead: 0 deg}}`."
    )
    output: Mapping[str, Mapping[str, object]] = key(default={}, help="Output, with its terms.")
    rules: tuple[str, ...] | Mapping[str, Row] = key(
        default=(), help="Sentences; or a table, whose first row names two inputs and heads the columns."
    )
    method: Literal["sugeno", "mamdani"] = key(
        default="sugeno",
        help="Inference method: the terms of the output are numbers (`sugeno`) or fuzzy sets (`mamdani`).",
    )
    joined: Literal["product", "min"] | None = key(
        default=None,
        word="and",
        help="Conjunction of conditions; by default `product` for `sugeno`, `min` for `mamdani`.",
    )
    p: float | None = key(default=None, low=0.0, help="Proportional gain in 1/s, instead of rules.")
    d: float | None = key(default=None, low=0.0, help="Derivative gain, with `p`.")
    most: object = key(default=None, help="Maximum rate, with `p`, such as `120 deg/s`.")

    def diagnostics(self) -> Iterator[KeyDiagnostic]:
        """Yield an error for each row of a rule table that is not as long as the first row, the column names."""
        table = self.rules if isinstance(self.rules, Mapping) else {}
        columns = len(next(iter(table.values()), ()))
        for name, row in table.items():
            if columns and len(row) != columns:
                at = ("rules", name)
                message = f"row '{name}' has {len(row)} conclusions for {columns} columns"
                yield KeyDiagnostic(message, at, marks_key=True, about=(at,))


@keys
class ControllerFileKeys:
    """Keys of a controller file: name, summary, and the rule base of each axis."""

    controller: str = key(help="Name.")
    summary: str = key(default="", help="Description in a line.")
    predict: bool = key(default=True, help="Use the predicted position of the target, instead of the newest picture.")
    pan: RuleBaseKeys | None = key(default=None, help="Rule base for the pan of a head.")
    tilt: RuleBaseKeys | None = key(default=None, help="Rule base for the tilt of a head.")
    base: RuleBaseKeys | None = key(default=None, help="Rule base for the base of a robot with a head.")
    turn: RuleBaseKeys | None = key(default=None, help="Rule base for the base of a robot without a head.")


@dataclass(frozen=True, slots=True)
class ControllerConfig:
    """Controller: rule bases by name as plain values, with quantities as SI floats and rules as written."""

    name: str
    summary: str
    values: dict[str, object]


@dataclass(frozen=True, slots=True)
class TunableNumber:
    """A number in the rule bases of a controller file, which tuning may change: ``keys`` are the path of keys to it.

    ``mark`` is its position in the file, ``unit`` its unit as written there.
    """

    keys: tuple[str, ...]
    mark: Mark
    number: float
    unit: str


def load_controller(path: Path) -> ControllerConfig:
    """Read a controller file. Raises InvalidFileError; the rules are checked by the controller, not here."""
    return parse_controller(read_source(path))


def parse_controller(source: SourceText) -> ControllerConfig:
    """Return the controller in a text. Raises as ``load_controller``."""
    fields = fields_of(source, subject="a controller file")
    parsed = read_keys(fields, ControllerFileKeys)
    values = {key.text: _plain(node) for key, node in fields.entries() if key.text not in DESCRIPTION_KEYS}
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return ControllerConfig(parsed.controller, parsed.summary, values)


def tunable_numbers(source: SourceText) -> list[TunableNumber]:
    """Return the numbers in the rule bases of a controller file, each once. Raises InvalidFileError."""
    found: dict[Mark, TunableNumber] = {}
    for figure in _tunable_numbers(compose(source), ()):
        found.setdefault(figure.mark, figure)  # what an alias repeats stands where it was written first
    return list(found.values())


def replace_words(source: SourceText, changes: Mapping[Mark, str]) -> str:
    """Return the text of a file with the words at some positions replaced; all else, comments too, is unchanged."""
    lines = source.text.splitlines(keepends=True)
    for mark, word in sorted(changes.items(), reverse=True):
        line, start = lines[mark.line - 1], mark.column - 1
        lines[mark.line - 1] = line[:start] + word + line[start + mark.length :]
    return "".join(lines)


def name_changes(source: SourceText, name: str, summary: str) -> dict[Mark, str]:
    """Return the new words, by position, that set name and summary of a controller file.

    A name or summary that is written over several lines in the file is left out.
    """
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
