"""What a test file expects of a run, read into plain values that know where in the file they stand."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from config.cases import CROOKED, DEFAULT_ANGLE, DEFAULT_DISTANCE, ExpectKeys, PoseKeys
from config.declared import read_keys
from config.faults import Mark, one_of
from config.fields import Fields, value_of
from config.marked import Listing, Mapping, Node, Scalar
from config.units import in_dimension, seen
from drivers.api.keys import declared
from missions.executive.guard import REFLEXES
from missions.language.arguments import default_value
from missions.plugins.testing.moments import KnownNode, read_moment
from missions.plugins.testing.phrases import Phrase

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
    within: float = DEFAULT_DISTANCE
    heading: float | None = None
    askew: float = DEFAULT_ANGLE


@dataclass(frozen=True, slots=True)
class Grammar:
    """What a case has, for the names in an expectation: nodes, results, the robot's joints, the world's people."""

    known: KnownNode
    returns: Sequence[str]
    joints: Sequence[str] = ()
    people: Sequence[str] = ()


Read = Callable[[Fields, Node, Grammar], Iterator[Item]]


def read_expectations(case: Fields, told: ExpectKeys | None, grammar: Grammar) -> tuple[Expectation, ...]:
    """Return what the section ``expect`` of a case means, where its keys are right by themselves."""
    expect, found = case.node_of("expect"), []
    if told is None or not isinstance(expect, Mapping):
        return ()
    wrong = {path[1] for path in case.wrong if path[:1] == ("expect",) and len(path) > 1}
    for key in declared(ExpectKeys):
        node = expect.get(key.word)
        if node is None or key.word in wrong:
            continue
        before = len(case.faults)
        value = getattr(told, key.field)
        read = READERS.get(key.word)
        plain = _texts(node) if key.form == "either" else iter([Item(node.mark, value)])
        items = plain if read is None else read(case, node, grammar)
        found.append(Expectation(key.word, node.mark, tuple(items)))
        if not found[-1].items and key.word not in EMPTY and len(case.faults) == before:
            case.fault(node.mark, f"'{key.word}' names nothing")
    if not expect.entries:
        case.fault(expect.mark, "nothing is expected", "write expect: {result: success}")
    return tuple(found)


def _texts(node: Node) -> Iterator[Item]:
    """Yield the texts in a list, or a single one."""
    for item in _scalars(node):
        yield Item(item.mark, item.text)


def _heard_by(fields: Fields, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Yield who hears what: ``{Anna: [a text], Ben: []}``. An item is a name and texts; none is for nothing."""
    for name, heard in _entries(node):
        if grammar.people and name.text not in grammar.people:
            fields.fault(name.mark, f"nobody is called {seen(name.text)}", one_of(name.text, grammar.people))
        yield Item(name.mark, (name.text, tuple(text.text for text in _scalars(heard))))


def _nodes(fields: Fields, node: Node, grammar: Grammar) -> Iterator[Item]:
    for item in _scalars(node):
        _check(fields, item, grammar)
        yield Item(item.mark, item.text)


def _counts(fields: Fields, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Yield names, or names with how often: ``{gesture: 2}``. An item is a name and a count, None for any."""
    counted = [(name, value_of(count)) for name, count in _entries(node)]
    for name, count in counted or [(item, None) for item in _scalars(node)]:
        _check(fields, name, grammar)
        yield Item(name.mark, (name.text, count))


def _moments(fields: Fields, node: Node, grammar: Grammar) -> Iterator[Item]:
    for item in _scalars(node):
        phrase = Phrase(fields.source, item, fields.faults)
        moment = read_moment(phrase, grammar.known)
        phrase.end()
        yield Item(item.mark, moment)


def _reflexes(fields: Fields, node: Node, _: Grammar) -> Iterator[Item]:
    """Yield reflexes, each with more of it or without: ``bumper``, ``bumper left``."""
    for item in _scalars(node):
        name = item.text.split()[0]
        if name not in REFLEXES:
            fields.fault(item.mark, f"'reflexes' cannot be {seen(name)}", one_of(name, REFLEXES))
        yield Item(item.mark, item.text)


def _pose(fields: Fields, node: Node, _: Grammar) -> Iterator[Item]:
    pose = Fields(fields.source, node, fields.faults, what="'pose'")
    told = read_keys(pose, PoseKeys)
    turned = pose.node_of("heading")
    heading, askew = (None, DEFAULT_ANGLE) if turned is None else _angle(pose, "heading", turned, DEFAULT_ANGLE)
    yield Item(node.mark, Place(*told.near, told.within, heading, askew))


def _joints(fields: Fields, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Yield joints and their angles. An item is a name, an angle and how far it may be off (radians)."""
    for name, angle in _entries(node):
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


def _returned(fields: Fields, node: Node, grammar: Grammar) -> Iterator[Item]:
    """Yield results and their values. An item is a name and a value."""
    for name, value in _entries(node):
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


def _scalars(node: Node) -> list[Scalar]:
    """Return the texts in a list, or a single one."""
    return [item for item in (node.items if isinstance(node, Listing) else [node]) if isinstance(item, Scalar)]


def _entries(node: Node) -> list[tuple[Scalar, Node]]:
    return node.entries if isinstance(node, Mapping) else []


READERS: dict[str, Read] = {
    "heard_by": _heard_by,
    "ran": _counts,
    "never_ran": _nodes,
    "succeeded": _nodes,
    "failed": _nodes,
    "order": _moments,
    "reflexes": _reflexes,
    "pose": _pose,
    "joints": _joints,
    "returns": _returned,
}
"""How the keys are read whose values mean something of the case; the others are what they say."""
