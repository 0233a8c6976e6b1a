"""Texts that look like calculations: they lack the ``${...}`` around them."""

from config.marked import Node, Scalar
from config.units import quantity, seen
from missions.language.expressions import ExpressionError, calculates, parse
from missions.language.notes import Notes


def check_text(notes: Notes, name: Scalar, node: Node) -> None:
    """Note a text that calculates with a variable, where ``name`` is set to it. A quoted one is meant."""
    if not isinstance(node, Scalar) or node.quoted or not isinstance(node.value, str) or quantity(node.text):
        return
    try:
        formula = parse(node.text)
    except ExpressionError:
        return
    if calculates(formula) and any(read.name in notes.params or read.name in notes.stored for read in formula.reads):
        message = f"'{name.text}' is set to the text {seen(node.text)}, which is not calculated"
        hint = f'write {name.text}: "${{{node.text}}}", or quotes around it for the text'
        notes.fault(node.mark, message, hint)
