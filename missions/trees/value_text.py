"""Texts for values in all views of a run: times, percepts, and variables."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from math import degrees, isfinite
from typing import NamedTuple

from config.units import Quantity, quantity_text
from missions.executive.events import VariableSet
from missions.language.expressions import format_value
from missions.language.kinds import member_dimensions
from missions.trees.drawing import TreeDrawing
from missions.trees.drawing_builder import one_line
from perception.api import UNKNOWN, Face, Marker, Percept, Thing

MAX_SHOWN_LENGTH = 120
"""Maximum length of a variable's value as text."""


def seconds_text(time: float) -> str:
    """Return a time or duration as text: "12.50 s"."""
    return f"{time:.2f} s"


def count_text(number: int, noun: str) -> str:
    """Return a number with its noun in singular or plural: "1 picture", "2 pictures"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def percept_name(percept: Percept) -> str:
    """Return the name of a percept; without a name, its kind and number, such as "face 3"."""
    match percept:
        case Face(name=name) if name not in ("", UNKNOWN):
            return name
        case Thing(name=name, colour=colour, shape=shape):
            return name or f"{colour} {shape}"
        case Marker(name=name, number=number):
            return name or f"marker {number}"
        case _:
            return f"face {percept.id}"


def percept_text(percept: Percept) -> str:
    """Return a percept with its distance and bearing: "face 1, 1.4 m, 19° left"."""
    distance = f", {percept.distance:.1f} m" if isfinite(percept.distance) else ""
    return f"{percept_name(percept)}{distance}, {_bearing_text(degrees(percept.bearing))}"


def percepts_text(percepts: Iterable[Percept]) -> str:
    """Return several percepts as text, or that there are none."""
    return "; ".join(percept_text(percept) for percept in percepts) or "nothing found"


class NodeName(NamedTuple):
    """Title and place of a node or modifier ("greet.yaml, line 12")."""

    title: str
    place: str


def node_names(drawing: TreeDrawing) -> Mapping[str, NodeName]:
    """Return the names of all nodes and modifiers by key."""
    found = {}
    for box in drawing.root.walk():
        found[box.key] = NodeName(box.title, f"{box.file}, line {box.line}")
        for badge in box.badges:
            found[badge.key] = NodeName(f"{badge.kind} on {box.title}", f"{box.file}, line {badge.line}")
    return found


def value_text(value: object) -> str:
    """Return the value of a variable on one line, shortened if it is long, without Python syntax."""
    match value:
        case Percept():
            text = percept_text(value)
        case list() | tuple():
            text = ", ".join(map(_member_text, value)) or "nothing"
        case _:
            text = one_line(_plain(value))
    return text if len(text) <= MAX_SHOWN_LENGTH else f"{text[: MAX_SHOWN_LENGTH - 1]}…"


def variable_text(event: VariableSet) -> str:
    """Return the value of a variable event as text. A number is shown with the unit of the event's dimension."""
    value = event.value
    if event.dimension and isinstance(value, int | float) and not isinstance(value, Quantity) and isfinite(value):
        return quantity_text(value, event.dimension)
    return value_text(value)


def _plain(value: object) -> str:
    """Return a value as text; for an object, its fields that are numbers and texts: "Touch: side left"."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {_member_text(each)}" for name, each in value.items()) or "nothing"
    if isinstance(value, type) or not is_dataclass(value):
        return format_value(value)
    sizes = member_dimensions(value.__class__)
    held = {each.name: getattr(value, each.name) for each in fields(value)}
    told = {name: each for name, each in held.items() if isinstance(each, bool | int | float | str)}
    members = (f"{name} {_with_unit(each, sizes.get(name, ''))}" for name, each in told.items())
    return f"{type(value).__name__}: {', '.join(members)}"


def _member_text(value: object) -> str:
    """Return a member as text, with brackets around a list and braces around a mapping."""
    match value:
        case Mapping():
            return f"{{{value_text(value)}}}"
        case list() | tuple():
            return f"[{value_text(value)}]"
        case _:
            return value_text(value)


def _with_unit(value: object, dimension: str) -> str:
    if dimension and isinstance(value, int | float) and isfinite(value):
        return quantity_text(value, dimension)
    return format_value(value)


def _bearing_text(angle: float) -> str:
    if not isfinite(angle) or abs(angle) < 0.5:
        return "straight ahead"
    return f"{abs(angle):.0f}° {'left' if angle > 0 else 'right'}"
