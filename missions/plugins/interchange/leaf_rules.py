"""Table of leaves of other programs that a leaf of missions can replace, and how their ports become its arguments.

Users extend the table by a YAML file with one key, ``leaves``::

    leaves:
      SaySomething: {leaf: say, ports: {message: text}}
      Spin: {leaf: turn, ports: {spin_dist: angle in rad, time_allowance: timeout in s}}
      Retreat: {leaf: drive, ports: {distance: -distance in m}}
      Bow: {leaf: gesture, with: {gesture: hello}}
      ComputePathToPose: {outputs: [path]}

Each port has the name of an argument, with the unit of the port's number. The minus in ``-distance in m`` reverses the
sign, and ``|speed| in m/s`` drops it. ``with`` has constant arguments. ``outputs`` are the ports that the leaf writes:
if a leaf of missions replaces it, ``as`` stores the first of them.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from behaviours.leaf import Argument, Leaf
from config.diagnostics import Diagnostic, InvalidFileError, suggest_from
from config.units import UNITS
from config.yaml_nodes import Listing, Node, Scalar, compose, read_source
from config.yaml_nodes import Mapping as Entries
from missions.language.arguments import check_constant
from missions.plugins.interchange.yaml_ports import entries_of, flow_text

RULE_KEYS = ("leaf", "ports", "with", "outputs")
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

    ``constants`` are further arguments, as YAML. ``outputs`` are the ports that the leaf writes. If ``leaf`` is empty,
    the rule only declares them. ``place`` is the rule's line in the user's table.
    """

    leaf: str = ""
    ports: Mapping[str, PortRule] = field(default_factory=dict)
    outputs: tuple[str, ...] = ()
    constants: Mapping[str, str] = field(default_factory=dict)
    place: str = ""


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
            found[name.text] = _read_rule(node, leaves, f"{path.name}:{name.mark.line}")
        except ValueError as error:
            faults.append(Diagnostic(source, node.mark, f"'{name.text}': {error}"))
    if faults:
        raise InvalidFileError(faults)
    return found


def _read_rule(node: Node, leaves: Mapping[str, type[Leaf]], place: str) -> LeafRule:
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
    outputs = node.get("outputs")
    if outputs is not None and not isinstance(outputs, Listing):
        raise ValueError("'outputs' needs a list of ports, [pose]")
    names = tuple(map(_word, outputs.items)) if outputs is not None else ()
    ports, constants = (_entries(node, key, leaf) for key in ("ports", "with"))
    if not leaf:
        return LeafRule(outputs=names, place=place)
    if names and not leaves[leaf].output_doc:
        raise ValueError(f"'{leaf}' has no output, so that 'outputs' has no effect")
    rules = {name: read_port_rule(_word(each)) for name, each in ports.items()}
    for name, rule in rules.items():
        _check_port(leaves[leaf], rule)
        if rule.argument in constants:
            raise ValueError(f"'{rule.argument}' has a constant in 'with' and the port '{name}'")
    texts = {name: _constant(leaves[leaf], name, each) for name, each in constants.items()}
    return LeafRule(leaf, rules, names, texts, place)


def _check_port(leaf: type[Leaf], rule: PortRule) -> None:
    """Raise ValueError if the leaf has no such argument, or one of another dimension."""
    argument = _argument(leaf, rule.argument, timeout=bool(rule.unit))
    if rule.unit and argument.kind != "value" and rule.unit not in UNITS.get(argument.kind, ()):
        raise ValueError(f"the unit '{rule.unit}' does not suit '{rule.argument}', a {argument.kind}")


def _constant(leaf: type[Leaf], name: str, node: Node) -> str:
    """Return a constant argument as YAML. Raises ValueError for values that the leaf does not accept."""
    argument, text = _argument(leaf, name), flow_text(node)
    if "${" in text:
        raise ValueError(f"'with' takes constants; name the port of '{name}' in 'ports'")
    if isinstance(node, Scalar):
        check_argument(argument, node.value)
    return text


def _entries(rule: Entries, key: str, leaf: str) -> Mapping[str, Node]:
    """Return the mapping at a key of a rule; empty without the key. Raises ValueError for others."""
    node = rule.get(key)
    if node is not None and not isinstance(node, Entries):
        raise ValueError(f"'{key}' needs " + {"ports": "ports and arguments, {message: text}"}.get(key, WITH_EXAMPLE))
    if node is not None and not leaf:
        raise ValueError(f"'{key}' needs a 'leaf' beside it")
    return entries_of(node)


WITH_EXAMPLE = "arguments and values, {gesture: hello}"
TIMEOUT_ARGUMENT = Argument(TIMEOUT, "duration", "")


def _argument(leaf: type[Leaf], name: str, *, timeout: bool = False) -> Argument:
    """Return an argument of a leaf, or the modifier ``timeout``, if that is possible. Raises ValueError."""
    if timeout and name == TIMEOUT and name not in leaf.arguments:
        return TIMEOUT_ARGUMENT
    if name not in leaf.arguments:
        known = ", ".join(leaf.arguments)
        raise ValueError(f"'{leaf.tag}' has no argument '{name}'; it has {known or 'none'}")
    return leaf.arguments[name]


def check_argument(argument: Argument, value: object) -> None:
    """Raise ValueError, with the name of the argument, if a constant does not suit it."""
    try:
        check_constant(argument, value)
    except ValueError as error:
        raise ValueError(f"'{argument.name}' {error}") from error


def _word(node: Node | None) -> str:
    return node.text if isinstance(node, Scalar) else ""
