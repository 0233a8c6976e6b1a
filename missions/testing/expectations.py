"""What a test file expects of a run, read into plain values that know where in the file they stand."""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from config.faults import Mark, one_of
from config.fields import Fields
from config.marked import Listing, Mapping, Node, Scalar
from config.units import in_dimension, seen
from drivers.api import Mood
from missions.executive.guard import REFLEXES
from missions.language.arguments import default_value
from missions.testing.moments import KnownNode, read_moment
from missions.testing.phrases import Phrase

RESULTS = ("success", "failure", "error", "interrupted")
"""How a run can end."""

NEAR = 0.1
"""Metres from where it is expected within which a base is there, unless the file says otherwise."""

ASKEW = math.radians(10)
"""The same for its heading."""

CROOKED = math.radians(3)
"""The same for a joint."""

EMPTY = ("said", "showed", "moods", "notified", "faults", "reflexes")
"""The keys whose list may be empty, which means that there must be none."""


@dataclass(frozen=True, slots=True)
class Item:
    """One thing that is expected, and where the file says so. ``value`` is what the key's reader makes of it."""

    mark: Mark
    value: Any


@dataclass(frozen=True, slots=True)
class Expectation:
    """All items under one key of ``expect``, in the file's order; ``mark`` is where they begin."""

    key: str
    mark: Mark
    items: tuple[Item, ...]


@dataclass(frozen=True, slots=True)
class Place:
    """Where a base is to be, in metres and radians: within ``within`` of (x, y), and of ``heading`` where there is one.

    In the frame of the world, as its file has it.
    """

    x: float
    y: float
    within: float = NEAR
    heading: float | None = None
    askew: float = ASKEW


@dataclass(frozen=True, slots=True)
class Grammar:
    """What a case has, for the names in an expectation: nodes, results, the robot's joints, the world's people."""

    known: KnownNode
    returns: Sequence[str]
    joints: Sequence[str] = ()
    people: Sequence[str] = ()


Read = Callable[[Fields, str, Node, Grammar], Iterator[Item]]


def read_expectations(fields: Fields, grammar: Grammar) -> tuple[Expectation, ...]:
    """Read the mapping under ``expect``."""
    found = []
    for key, read in READERS.items():
        node = fields.node_of(key)
        if node is None:
            continue
        before = len(fields.faults)
        found.append(Expectation(key, node.mark, tuple(read(fields, key, node, grammar))))
        if not found[-1].items and key not in EMPTY and len(fields.faults) == before:
            fields.fault(node.mark, f"'{key}' names nothing")
    fields.done()
    if not found and isinstance(fields.node, Mapping) and not fields.node.entries:
        fields.fault(fields.node.mark, "nothing is expected", "write expect: {result: success}")
    return tuple(found)


def _result(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    del grammar
    yield Item(node.mark, fields.choice(key, RESULTS))


def _text(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    del grammar
    yield Item(node.mark, fields.text(key))


def _duration(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    del grammar
    yield Item(node.mark, fields.quantity(key, "duration", low=0.0))


def _texts(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    del grammar
    for item in _scalars(fields, key, node):
        yield Item(item.mark, item.text)


def _words(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Read words on the screen; an empty text is for those that are taken away."""
    del grammar
    for item in _scalars(fields, key, node, empty=True):
        yield Item(item.mark, item.text)


def _heard_by(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Read who hears what: ``{Anna: [a text, another], Ben: []}``. An item is a name and texts; none is for nothing."""
    if not isinstance(node, Mapping):
        fields.fault(node.mark, f"'{key}' needs people and what they hear", "such as {Anna: [hello], Ben: []}")
        return
    for name, heard in node.entries:
        if grammar.people and name.text not in grammar.people:
            fields.fault(name.mark, f"nobody is called {seen(name.text)}", one_of(name.text, grammar.people))
        texts = _scalars(fields, f"{key}: {name.text}", heard)
        yield Item(name.mark, (name.text, tuple(text.text for text in texts)))


def _moods(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    del grammar
    for item in _scalars(fields, key, node):
        if item.text not in [*Mood]:
            fields.fault(item.mark, f"'{key}' cannot be {seen(item.text)}", one_of(item.text, [*Mood]))
        yield Item(item.mark, item.text)


def _nodes(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    for item in _scalars(fields, key, node):
        _check(fields, item, grammar)
        yield Item(item.mark, item.text)


def _counts(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Read names, or names with how often: ``{gesture: 2}``. An item is a name and a count, None for any."""
    if not isinstance(node, Mapping):
        for item in _scalars(fields, key, node):
            _check(fields, item, grammar)
            yield Item(item.mark, (item.text, None))
        return
    for name, count in node.entries:
        _check(fields, name, grammar)
        value = count.value if isinstance(count, Scalar) else None
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            fields.fault(count.mark, f"how often '{name.text}' has to start needs a whole number")
            continue
        yield Item(name.mark, (name.text, value))


def _moments(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    for item in _scalars(fields, key, node):
        phrase = Phrase(fields.source, item, fields.faults)
        moment = read_moment(phrase, grammar.known)
        phrase.end()
        yield Item(item.mark, moment)


def _reflexes(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Read reflexes, each with more of it or without: ``bumper``, ``bumper left``."""
    del grammar
    for item in _scalars(fields, key, node):
        name = item.text.split()[0]
        if name not in REFLEXES:
            fields.fault(item.mark, f"'{key}' cannot be {seen(name)}", one_of(name, REFLEXES))
        yield Item(item.mark, item.text)


def _rest(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    del grammar
    yield Item(node.mark, fields.choice(key, ("stopped",)))


def _pose(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    del grammar
    pose = Fields(fields.source, node, fields.faults, what=f"'{key}'")
    near = pose.items("near", required=True)
    x, y = (pose.measure(each, "near", "length") for each in near) if len(near) == 2 else (0.0, 0.0)
    if near and len(near) != 2:
        pose.fault(near[0].mark, "'near' needs a place, such as [1 m, 0 m]")
    turned = pose.node_of("heading")
    heading, askew = (None, ASKEW) if turned is None else _angle(pose, "heading", turned, ASKEW)
    within = pose.quantity("within", "length", NEAR, low=0.0)
    pose.done()
    yield Item(node.mark, Place(x, y, within, heading, askew))


def _joints(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Read joints and their angles. An item is a name, an angle and how far it may be off (radians)."""
    if not isinstance(node, Mapping):
        fields.fault(node.mark, f"'{key}' needs joints and their angles", "such as {elbow: 30 deg +- 5 deg}")
        return
    for name, angle in node.entries:
        if name.text in grammar.joints:
            yield Item(name.mark, (name.text, *_angle(fields, name.text, angle, CROOKED)))
        else:
            hint = one_of(name.text, grammar.joints) or "the mission uses no arm"
            fields.fault(name.mark, f"the robot has no joint {seen(name.text)}", hint)


def _angle(fields: Fields, key: str, node: Node, otherwise: float) -> tuple[float, float]:
    """Read ``90 deg``, or ``90 deg +- 5 deg``; how far it may be off is ``otherwise`` where nothing is said."""
    text = node.text if isinstance(node, Scalar) else ""
    middle, sign, either = (part.strip() for part in re.split(r"(\+-|±|$)", text, maxsplit=1))
    try:
        return in_dimension(middle, "angle"), in_dimension(either, "angle") if sign else otherwise
    except ValueError as error:
        fields.fault(node.mark, f"'{key}' {error}", f"write '{key}: 90 deg +- 5 deg'")
        return 0.0, otherwise


def _returned(fields: Fields, key: str, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Read results and their values. An item is a name and a value."""
    if not isinstance(node, Mapping):
        fields.fault(node.mark, f"'{key}' needs names and values", "such as {greeted: 2}")
        return
    for name, value in node.entries:
        if name.text not in grammar.returns:
            hint = one_of(name.text, grammar.returns) or "it returns nothing"
            fields.fault(name.mark, f"the mission returns no {seen(name.text)}", hint)
        elif not isinstance(value, Scalar):
            fields.fault(value.mark, f"'{name.text}' needs one value")
        else:
            yield Item(name.mark, (name.text, default_value(value)))


def _check(fields: Fields, name: Scalar, grammar: Grammar) -> None:
    problem = grammar.known(name.text)
    if problem:
        fields.fault(name.mark, problem)


def _scalars(fields: Fields, key: str, node: Node, *, empty: bool = False) -> Iterator[Scalar]:
    """One text, or a list of them; ``empty`` says whether one may be."""
    for item in node.items if isinstance(node, Listing) else [node]:
        if isinstance(item, Scalar) and item.value is not None and (item.text.strip() or (empty and not item.text)):
            yield item
        else:
            fields.fault(item.mark, f"'{key}' needs a text, or a list of texts")


READERS: dict[str, Read] = {
    "result": _result,
    "reason": _text,
    "within": _duration,
    "after": _duration,
    "said": _texts,
    "never_said": _texts,
    "heard_by": _heard_by,
    "showed": _words,
    "moods": _moods,
    "notified": _texts,
    "ran": _counts,
    "never_ran": _nodes,
    "succeeded": _nodes,
    "failed": _nodes,
    "order": _moments,
    "faults": _texts,
    "reflexes": _reflexes,
    "base": _rest,
    "pose": _pose,
    "joints": _joints,
    "returns": _returned,
}
"""How each key of ``expect`` is read."""
