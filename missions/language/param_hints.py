"""Hints for a param whose value does not fit where an expression uses it: its line, and the value to write there."""

import ast
import re

from config.units import EXAMPLES, UNITS, corrected_quantity, parse_quantity
from config.yaml_nodes import Scalar
from missions.language.expressions import Expression, Template

USUAL_UNITS = {"length": ("cm", "m"), "duration": ("s", "min"), "speed": ("cm/s", "m/s")}
"""Units to suggest for a number without a unit; the first unit of UNITS for other dimensions."""

_QUOTES = "“”„«»\"'\u2018\u2019\u201a"
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?")
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
_COUNT = re.compile(r"(\d+)\s*(?:times?|x|\u00d7)", re.IGNORECASE)
_PROPOSAL = re.compile(r"did you mean ('[^']+')")


def sole_name(formula: Template | Expression) -> str:
    """Return the name in ``${name}`` if ``formula`` is nothing else; empty otherwise."""
    match formula:
        case Template(parts=(Expression(tree=ast.Name(id=name)),)):
            return name
    return ""


def counted(text: str) -> str:
    """Return the number in a text such as "4 times"; empty for other texts."""
    found = _COUNT.fullmatch(text.strip())
    return found[1] if found else ""


def param_hint(name: str, node: Scalar, wanted_kind: object, message: str) -> str:
    """Return the hint to write another value at the param ``name``; empty if no better value is known.

    ``node`` is the param's default in the file, ``wanted_kind`` the kind of value that the expression needs, and
    ``message`` the error at the expression.
    """
    proposal = _PROPOSAL.search(message)
    value = proposal[1] if proposal else _better_value(node.text, str(wanted_kind))
    return f"param '{name}' (line {node.mark.line}): write {value}" if value else ""


def _better_value(text: str, wanted: str) -> str:
    if wanted == "count":
        return counted(text)
    if wanted not in UNITS:
        return ""
    plain = _DECIMAL_COMMA.sub(".", text.strip().strip(_QUOTES).strip())
    if _NUMBER.fullmatch(plain):
        units = USUAL_UNITS.get(wanted, tuple(UNITS[wanted])[:1])
        return " or ".join(f"'{plain} {unit}'" for unit in units)
    quantity = parse_quantity(corrected_quantity(plain) or plain)
    if quantity is None:
        return f"a value such as '{EXAMPLES[wanted]}'"
    return f"'{quantity.text}'" if quantity.dimension == wanted and quantity.text != text else ""
