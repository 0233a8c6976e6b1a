"""What a test file expects of a run, read into plain values that know where in the file they stand."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from config.cases import DISTANCE_TOLERANCE, HEADING_TOLERANCE, JOINT_TOLERANCE, ExpectKeys, PoseKeys
from config.diagnostics import Mark, suggest_from
from config.fields import Fields, value_of
from config.section_reader import read_keys
from config.units import quoted_value, si_value
from config.yaml_nodes import Listing, Mapping, Node, Scalar
from drivers.api.keys import declared_keys
from missions.executive.guard import REFLEXES
from missions.language.arguments import default_value
from missions.plugins.testing.event_specs import NodeError, read_event
from missions.plugins.testing.phrases import Phrase

MAY_BE_EMPTY = ("said", "showed", "moods", "notified", "faults", "reflexes")
"""The keys whose list may be empty, which means that there must be none."""


@dataclass(frozen=True, slots=True)
class ExpectedItem:
    """One thing that is expected, and where the file says so. ``value`` is what the key's reader makes of it."""

    mark: Mark
    value: Any


@dataclass(frozen=True, slots=True)
class Expectation:
    """All items under one key of ``expect``, in the file's order; ``mark`` is where they begin."""

    key: str
    mark: Mark
    items: tuple[ExpectedItem, ...]


@dataclass(frozen=True, slots=True)
class PoseTarget:
    """Where a base is to be, in metres and radians: within ``max_distance`` of (x, y), and of ``heading`` where there is one.

    In the frame of the world, as its file has it.
    """

    x: float
    y: float
    max_distance: float = DISTANCE_TOLERANCE
    heading: float | None = None
    max_angle: float = HEADING_TOLERANCE


@dataclass(frozen=True, slots=True)
class CaseNames:
    """What a case has, for the names in an expectation: nodes, results, the robot's joints, the world's people."""

    node_error: NodeError
    returns: Sequence[str]
    joints: Sequence[str] = ()
    people: Sequence[str] = ()


ReadItems = Callable[[Fields, Node, CaseNames], Iterator[ExpectedItem]]


def read_expectations(case: Fields, keys: ExpectKeys | None, names: CaseNames) -> tuple[Expectation, ...]:
    """Return what the section ``expect`` of a case means, where its keys are right by themselves."""
    expect, found = case.node_of("expect"), []
    if keys is None or not isinstance(expect, Mapping):
        return ()
    wrong = {path[1] for path in case.wrong_places if path[:1] == ("expect",) and len(path) > 1}
    for key in declared_keys(ExpectKeys):
        node = expect.get(key.word)
        if node is None or key.word in wrong:
            continue
        before = len(case.diagnostics)
        value = getattr(keys, key.field)
        read = READERS.get(key.word)
        plain = _read_texts(node) if key.form == "either" else iter([ExpectedItem(node.mark, value)])
        items = plain if read is None else read(case, node, names)
        found.append(Expectation(key.word, node.mark, tuple(items)))
        if not found[-1].items and key.word not in MAY_BE_EMPTY and len(case.diagnostics) == before:
            case.add_error(node.mark, f"'{key.word}' names nothing")
    if not expect.entries:
        case.add_error(expect.mark, "nothing is expected", "write expect: {result: success}")
    return tuple(found)


def _read_texts(node: Node) -> Iterator[ExpectedItem]:
    """Yield the texts in a list, or a single one."""
    for item in _scalars(node):
        yield ExpectedItem(item.mark, item.text)


def _read_heard_by(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    """Yield who hears what: ``{Anna: [a text], Ben: []}``. An item is a name and texts; none is for nothing."""
    for name, heard in _entries(node):
        if names.people and name.text not in names.people:
            fields.add_error(
                name.mark, f"nobody is called {quoted_value(name.text)}", suggest_from(name.text, names.people)
            )
        yield ExpectedItem(name.mark, (name.text, tuple(text.text for text in _scalars(heard))))


def _read_nodes(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    for item in _scalars(node):
        _check_node(fields, item, names)
        yield ExpectedItem(item.mark, item.text)


def _read_counts(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    """Yield names, or names with how often: ``{gesture: 2}``. An item is a name and a count, None for any."""
    counted = [(name, value_of(count)) for name, count in _entries(node)]
    for name, count in counted or [(item, None) for item in _scalars(node)]:
        _check_node(fields, name, names)
        yield ExpectedItem(name.mark, (name.text, count))


def _read_order(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    for item in _scalars(node):
        phrase = Phrase(fields.source, item, fields.diagnostics)
        moment = read_event(phrase, names.node_error)
        phrase.expect_end()
        yield ExpectedItem(item.mark, moment)


def _read_reflexes(fields: Fields, node: Node, _: CaseNames) -> Iterator[ExpectedItem]:
    """Yield reflexes, each with more of it or without: ``bumper``, ``bumper left``."""
    for item in _scalars(node):
        name = item.text.split()[0]
        if name not in REFLEXES:
            fields.add_error(item.mark, f"'reflexes' cannot be {quoted_value(name)}", suggest_from(name, REFLEXES))
        yield ExpectedItem(item.mark, item.text)


def _read_pose(fields: Fields, node: Node, _: CaseNames) -> Iterator[ExpectedItem]:
    pose = Fields(fields.source, node, fields.diagnostics, subject="'pose'")
    told = read_keys(pose, PoseKeys)
    turned = pose.node_of("heading")
    heading, askew = (
        (None, HEADING_TOLERANCE) if turned is None else _read_angle(pose, "heading", turned, HEADING_TOLERANCE)
    )
    yield ExpectedItem(node.mark, PoseTarget(*told.near, told.within, heading, askew))


def _read_joints(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    """Yield joints and their angles. An item is a name, an angle and how far it may be off (radians)."""
    for name, angle in _entries(node):
        if name.text in names.joints:
            yield ExpectedItem(name.mark, (name.text, *_read_angle(fields, name.text, angle, JOINT_TOLERANCE)))
        else:
            hint = suggest_from(name.text, names.joints) or "the mission uses no arm"
            fields.add_error(name.mark, f"the robot has no joint {quoted_value(name.text)}", hint)


def _read_angle(fields: Fields, key: str, node: Node, default_tolerance: float) -> tuple[float, float]:
    """Read ``90 deg``, or ``90 deg +- 5 deg``; how far it may be off is ``otherwise`` where nothing is said."""
    text = node.text if isinstance(node, Scalar) else ""
    middle, sign, either = (part.strip() for part in re.split(r"(\+-|±|$)", text, maxsplit=1))
    try:
        return si_value(middle, "angle"), si_value(either, "angle") if sign else default_tolerance
    except ValueError as error:
        fields.add_error(node.mark, f"'{key}' {error}", f"write '{key}: 90 deg +- 5 deg'")
        return 0.0, default_tolerance


def _read_returns(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    """Yield results and their values. An item is a name and a value."""
    for name, value in _entries(node):
        if name.text not in names.returns:
            hint = suggest_from(name.text, names.returns) or "it returns nothing"
            fields.add_error(name.mark, f"the mission returns no {quoted_value(name.text)}", hint)
        elif not isinstance(value, Scalar):
            fields.add_error(value.mark, f"'{name.text}' needs one value")
        else:
            yield ExpectedItem(name.mark, (name.text, default_value(value)))


def _check_node(fields: Fields, name: Scalar, names: CaseNames) -> None:
    problem = names.node_error(name.text)
    if problem:
        fields.add_error(name.mark, problem)


def _scalars(node: Node) -> list[Scalar]:
    """Return the texts in a list, or a single one."""
    return [item for item in (node.items if isinstance(node, Listing) else [node]) if isinstance(item, Scalar)]


def _entries(node: Node) -> list[tuple[Scalar, Node]]:
    return node.entries if isinstance(node, Mapping) else []


READERS: dict[str, ReadItems] = {
    "heard_by": _read_heard_by,
    "ran": _read_counts,
    "never_ran": _read_nodes,
    "succeeded": _read_nodes,
    "failed": _read_nodes,
    "order": _read_order,
    "reflexes": _read_reflexes,
    "pose": _read_pose,
    "joints": _read_joints,
    "returns": _read_returns,
}
"""How the keys are read whose values mean something of the case; the others are what they say."""
