"""Arguments that name a face: only a variable holds one, which ``as`` has kept."""

import ast

from behaviours.leaf import Leaf
from config.marked import Scalar
from config.units import seen
from missions.language.expressions import Expression
from missions.language.notes import Notes
from missions.language.operators import described
from missions.language.values import UNREAD, Template, Value
from perception.api import Face

KIND = "face"
"""The kind of these arguments."""


def read_face(notes: Notes, node: Scalar, what: str) -> Value:
    """Read such an argument: ``${person}``, or nothing."""
    if node.value is None:
        return Value()
    if "${" not in node.text:
        hint = f'write "${{{node.text}}}"' if node.text in notes.stored else _how(notes)
        notes.fault(node.mark, f"{what} needs a face kept by 'as', got the text {seen(node.text)}", hint)
        return UNREAD
    found = notes.value(node, what, as_face)
    kept = notes.kept.get(_variable(found.template))
    if kept is not None and kept.keeps is not None and not _is_face(kept):
        notes.fault(node.mark, f"{what} needs a face kept by 'as', got what '{kept.word}' keeps", _how(notes))
        return UNREAD
    return found


def as_face(value: object) -> Face | None:
    """Return a face, or None. Raises ValueError for anything else."""
    if value is None or isinstance(value, Face):
        return value
    raise ValueError(f"needs a face kept by 'as', got {described(value)}")


def _variable(formula: Template | Expression | None) -> str:
    """Return the variable of which a template's value is all; empty where it is more than that."""
    match formula:
        case Template(parts=(Expression(tree=ast.Name(id=name)),)):
            return name
    return ""


def _is_face(leaf: type[Leaf]) -> bool:
    return isinstance(leaf.keeps, type) and issubclass(leaf.keeps, Face)


def _how(notes: Notes) -> str:
    """Say what to write: a variable that holds a face, where there is one."""
    faces = [name for name, leaf in notes.kept.items() if _is_face(leaf)]
    return f'write "${{{faces[0]}}}"' if faces else 'keep one with as: person, beside find_face, and write "${person}"'
