"""How values are put into words wherever a run is shown: times, what was seen, and what a variable holds."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from math import degrees, isfinite
from typing import NamedTuple

from config.units import Quantity, written
from missions.executive.events import VariableSet
from missions.language.expressions import shown
from missions.language.kinds import dimensions_of
from missions.trees.draw import one_line
from missions.trees.drawing import Drawing
from perception.api import UNKNOWN, Face, Marker, Percept, Thing

MAX_SHOWN_LENGTH = 120
"""Characters of a value that are shown."""


def in_seconds(time: float) -> str:
    """Return a time or a duration: "12.50 s"."""
    return f"{time:.2f} s"


def counted(number: int, noun: str) -> str:
    """Return "1 picture", "2 pictures"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def name_of(percept: Percept) -> str:
    """Return what something seen is called: by its name where that is known, else by its number."""
    match percept:
        case Face(name=name) if name not in ("", UNKNOWN):
            return name
        case Thing(name=name, colour=colour, shape=shape):
            return name or f"{colour} {shape}"
        case Marker(name=name, number=number):
            return name or f"marker {number}"
        case _:
            return f"face {percept.id}"


def about(percept: Percept) -> str:
    """Return what is seen, how far away, and how far beside the camera's axis: "face 1, 1.4 m, 19° left"."""
    distance = f", {percept.distance:.1f} m" if isfinite(percept.distance) else ""
    return f"{name_of(percept)}{distance}, {_aside(degrees(percept.bearing))}"


def about_all(percepts: Iterable[Percept]) -> str:
    """Return what is seen together; that it is nothing, where it is."""
    return "; ".join(about(percept) for percept in percepts) or "nothing found"


class Named(NamedTuple):
    """A node or modifier as people find it: what it is, and where it stands ("greet.yaml, line 12")."""

    title: str
    place: str


def names_in(drawing: Drawing) -> Mapping[str, Named]:
    """Return what every node and modifier is called, by its key."""
    found = {}
    for box in drawing.root.walk():
        found[box.key] = Named(box.title, f"{box.file}, line {box.line}")
        for badge in box.badges:
            found[badge.key] = Named(f"{badge.kind} on {box.title}", f"{box.file}, line {badge.line}")
    return found


def in_words(value: object) -> str:
    """Return the value of a variable on one line, cut where it is long: no object as Python writes it."""
    match value:
        case Percept():
            text = about(value)
        case list() | tuple():
            text = ", ".join(in_words(each) for each in value) or "nothing"
        case _:
            text = one_line(_plain(value))
    return text if len(text) <= MAX_SHOWN_LENGTH else f"{text[: MAX_SHOWN_LENGTH - 1]}…"


def variable_in_words(event: VariableSet) -> str:
    """Return what a variable holds; a quantity of a record, which is in SI units there, with its unit."""
    value = event.value
    if event.dimension and isinstance(value, int | float) and not isinstance(value, Quantity) and isfinite(value):
        return written(value, event.dimension)
    return in_words(value)


def _plain(value: object) -> str:
    """Return a value as people write it; an object by its fields that are numbers and texts: "Touch: side left"."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {in_words(each)}" for name, each in value.items()) or "nothing"
    if isinstance(value, type) or not is_dataclass(value):
        return shown(value)
    sizes = dimensions_of(value.__class__)
    held = {each.name: getattr(value, each.name) for each in fields(value)}
    told = {name: each for name, each in held.items() if isinstance(each, bool | int | float | str)}
    members = (f"{name} {_with_unit(each, sizes.get(name, ''))}" for name, each in told.items())
    return f"{type(value).__name__}: {', '.join(members)}"


def _with_unit(value: object, dimension: str) -> str:
    if dimension and isinstance(value, int | float) and isfinite(value):
        return written(value, dimension)
    return shown(value)


def _aside(angle: float) -> str:
    if not isfinite(angle) or abs(angle) < 0.5:
        return "straight ahead"
    return f"{abs(angle):.0f}° {'left' if angle > 0 else 'right'}"
