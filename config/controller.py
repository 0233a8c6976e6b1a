"""Controller files: the rule bases of a fuzzy controller, with their quantities in SI units."""

from dataclasses import dataclass
from pathlib import Path

from config.faults import InvalidFileError
from config.fields import Fields, read_fields
from config.marked import Listing, Mapping, Node, Scalar
from config.units import quantity


@dataclass(frozen=True, slots=True)
class ControllerConfig:
    """A controller: its rule bases by name as plain values, every quantity an SI float, every rule as written."""

    name: str
    summary: str
    values: dict[str, object]


def load_controller(path: Path) -> ControllerConfig:
    """Read a controller file. Raises InvalidFileError when it is none; what its rules mean, the controller checks."""
    fields = read_fields(path, what="a controller file")
    name, summary = fields.text("controller"), fields.text("summary", "")
    values = {key.text: _plain(node) for key, node in fields.entries() if key.text not in ("controller", "summary")}
    _check_tables(fields, fields.node)
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return ControllerConfig(name, summary, values)


def _plain(node: Node) -> object:
    if isinstance(node, Listing):
        return [_plain(item) for item in node.items]
    if isinstance(node, Mapping):
        return {key.text: _plain(value) for key, value in node.entries}
    measured = quantity(node.text)
    return node.value if measured is None else float(measured)


def _check_tables(fields: Fields, node: Node) -> None:
    """Note every row of a rule table that is longer or shorter than the table's first row, which names the columns."""
    if not isinstance(node, Mapping):
        return
    for key, value in node.entries:
        if key.text == "rules" and isinstance(value, Mapping):
            _check_rows(fields, value)
        elif not isinstance(value, Scalar):
            _check_tables(fields, value)


def _check_rows(fields: Fields, table: Mapping) -> None:
    columns = 0
    for place, (name, row) in enumerate(table.entries):
        if not isinstance(row, Listing):
            fields.fault(row.mark, f"row '{name.text}' needs a list: [one conclusion for each column]")
        elif place == 0:
            columns = len(row.items)
        elif len(row.items) != columns and columns:
            fields.fault(name.mark, f"row '{name.text}' has {len(row.items)} conclusions for {columns} columns")
