"""Texts of arguments that mean something else: what finds the thing, the file or the mission that one names.

Faces are named by variables alone, which ``as`` has kept; and a calculation without its ``${...}`` is told of.
"""

import ast
from collections.abc import Callable
from functools import partial
from pathlib import Path

from behaviours.leaf import Leaf
from config.marked import Node, Scalar
from config.units import quantity, seen
from missions.language.expressions import Expression, ExpressionError, calculates, parse
from missions.language.nodes import MISSION
from missions.language.notes import Notes
from missions.language.operators import described
from missions.language.values import UNREAD, Convert, Template, Value, shown
from perception.api import Face


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


def finder(notes: Notes, kind: str) -> Convert | None:
    """Return what finds the things of a kind by their names, and raises LookupError; None for what is no thing."""
    folder = Path(notes.source.name).parent
    if kind == "file":
        return partial(_file, notes.things.get(kind, Path), folder)
    if kind == MISSION:
        return lambda value: notes.words.find_mission(shown(value), folder)
    return partial(_find, notes.things[kind]) if kind in notes.things else None


def _find(lookup: Callable[[str], object], value: object) -> object:
    return lookup(shown(value))


def _file(lookup: Callable[[str], object], folder: Path, value: object) -> object:
    """Return the file at a path that goes from the mission's folder."""
    return lookup(str(folder / shown(value)))
