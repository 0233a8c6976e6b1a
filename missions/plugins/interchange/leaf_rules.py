"""Table of leaves of other programs that a leaf of missions can replace, and how their ports become its arguments.

Users extend the table by a YAML file with one key, ``leaves``::

    leaves:
      SaySomething: {leaf: say, ports: {message: text}}
      Spin: {leaf: turn, ports: {spin_dist: angle in rad, time_allowance: timeout in s}}
      Retreat: {leaf: drive, ports: {distance: -distance in m}}
      ComputePathToPose: {outputs: [path]}

Each port has the name of an argument, with the unit of the port's number. The minus in ``-distance in m`` reverses the
sign, and ``|speed| in m/s`` drops it. ``outputs`` are the ports that the leaf writes. If a leaf of missions replaces
it, ``as`` stores the first output.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from behaviours.leaf import Leaf
from config.diagnostics import Diagnostic, InvalidFileError, suggest_from
from config.units import UNITS
from config.yaml_nodes import Listing, Node, Scalar, compose, read_source
from config.yaml_nodes import Mapping as Entries

RULE_KEYS = ("leaf", "ports", "outputs")
PORT_RULE = re.compile(r"(?P<sign>-?)(?P<size>\|?)(?P<argument>[A-Za-z_]\w*)(?P=size)(?:\s+in\s+(?P<unit>\S+))?")
TIMEOUT = "timeout"
"""Name in a table of leaves for a port that becomes the modifier ``timeout``, instead of an argument."""


@dataclass(frozen=True, slots=True)
class PortRule:
    """How a port becomes an ``argument`` of a leaf.

    ``unit`` is that of the port's number. ``drops_sign`` takes its size, and ``reversed`` then negates it.
    """

    argument: str
    unit: str = ""
    reversed: bool = False
    drops_sign: bool = False


@dataclass(frozen=True, slots=True)
class LeafRule:
    """How a leaf of another program is translated: the tag of the mission's ``leaf``, and an argument for each port.

    ``outputs`` are the ports that the leaf writes. If ``leaf`` is empty, the rule only declares them.
    """

    leaf: str = ""
    ports: Mapping[str, PortRule] = field(default_factory=dict)
    outputs: tuple[str, ...] = ()


def _rule(leaf: str, **ports: str) -> LeafRule:
    return LeafRule(leaf, {port: read_port_rule(text) for port, text in ports.items()})


def read_port_rule(text: str) -> PortRule:
    """Return the rule in a text such as ``angle in rad``: an argument and a unit. Raises ValueError."""
    found = PORT_RULE.fullmatch(text.strip())
    if found is None:
        raise ValueError("write an argument, such as 'text', or with a unit, such as 'angle in rad'")
    unit = found["unit"] or ""
    if unit and not any(unit in units for units in UNITS.values()):
        raise ValueError(f"unknown unit '{unit}'")
    return PortRule(found["argument"], unit, found["sign"] == "-", bool(found["size"]))


LEAF_RULES: Mapping[str, LeafRule] = {
    "Wait": _rule("wait", wait_duration="duration in s"),
    "Spin": _rule("turn", spin_dist="angle in rad", time_allowance="timeout in s"),
    "BackUp": _rule(  # backs up whatever the signs are: nav2_behaviors/plugins/back_up.cpp
        "drive", backup_dist="-|distance| in m", backup_speed="|speed| in m/s", time_allowance="timeout in s"
    ),
    "DriveOnHeading": _rule(
        "drive", dist_to_travel="distance in m", speed="|speed| in m/s", time_allowance="timeout in s"
    ),
}
"""Rules for leaves of Nav2 that a leaf of missions can replace, such as Spin by ``turn``."""


def read_rules(path: Path, leaves: Mapping[str, type[Leaf]]) -> dict[str, LeafRule]:
    """Read a user's table of leaves from a YAML file. Raises InvalidFileError with all mistakes in the file."""
    source, faults = read_source(path), list[Diagnostic]()
    root = compose(source, faults)
    table = root.get("leaves") if isinstance(root, Entries) else None
    if not isinstance(table, Entries):
        faults.append(Diagnostic(source, root.mark, "needs the key 'leaves', with a node under each name"))
        raise InvalidFileError(faults)
    found = {}
    for name, node in table.entries:
        try:
            found[name.text] = _read_rule(node, leaves)
        except ValueError as error:
            faults.append(Diagnostic(source, node.mark, f"'{name.text}': {error}"))
    if faults:
        raise InvalidFileError(faults)
    return found


def _read_rule(node: Node, leaves: Mapping[str, type[Leaf]]) -> LeafRule:
    if not isinstance(node, Entries) or not node.entries:
        raise ValueError("write {leaf: NAME, ports: {PORT: ARGUMENT}}")
    for key in node.keys():  # noqa: SIM118 - no dict
        if key not in RULE_KEYS:
            hint = suggest_from(key, RULE_KEYS)
            raise ValueError(f"unknown key '{key}'" + (f"; {hint}" if hint else ""))
    leaf = _word(node.get("leaf"))
    if leaf and leaf not in leaves:
        hint = suggest_from(leaf, leaves)
        raise ValueError(f"unknown behaviour '{leaf}'" + (f"; {hint}" if hint else ""))
    ports = node.get("ports")
    if ports is not None and not isinstance(ports, Entries):
        raise ValueError("'ports' needs ports and arguments, {message: text}")
    rules = {name.text: read_port_rule(_word(each)) for name, each in ports.entries} if ports is not None else {}
    for rule in rules.values():
        if leaf and rule.argument != TIMEOUT and rule.argument not in leaves[leaf].arguments:
            known = ", ".join(leaves[leaf].arguments)
            raise ValueError(f"'{leaf}' has no argument '{rule.argument}'; it has {known or 'none'}")
    outputs = node.get("outputs")
    names = tuple(_word(each) for each in outputs.items) if isinstance(outputs, Listing) else ()
    return LeafRule(leaf, rules, names)


def _word(node: Node | None) -> str:
    return node.text if isinstance(node, Scalar) else ""
