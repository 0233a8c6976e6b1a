"""Expectations of a test file, parsed into plain values with their positions in the file."""

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
from missions.plugins.testing.event_specs import NodeError, read_event
from missions.plugins.testing.mock_results import plain_data
from missions.plugins.testing.phrases import Phrase

MAY_BE_EMPTY = ("said", "showed", "moods", "notified", "faults", "reflexes")
"""Keys of ``expect`` whose list may be empty. An empty list requires that the run has no event of this kind."""


@dataclass(frozen=True, slots=True)
class ExpectedItem:
    """Item of an expectation with its position in the file.

    ``value`` is the parsed item, as its function in READERS returns it.
    """

    mark: Mark
    value: Any


@dataclass(frozen=True, slots=True)
class Expectation:
    """All items under one key of ``expect``, in the file's order; ``mark`` is the position of the key's value."""

    key: str
    mark: Mark
    items: tuple[ExpectedItem, ...]


@dataclass(frozen=True, slots=True)
class PoseTarget:
    """Target pose of a base in the world frame, in metres and radians, with a tolerance of distance and heading."""

    x: float
    y: float
    max_distance: float = DISTANCE_TOLERANCE
    heading: float | None = None
    max_angle: float = HEADING_TOLERANCE


@dataclass(frozen=True, slots=True)
class CaseNames:
    """Names that the expectations of a case can use: nodes, results, the robot's joints, the world's people.

    ``returns`` is None if the mission has errors, so that its results are not known.
    """

    node_error: NodeError
    returns: Sequence[str] | None
    joints: Sequence[str] = ()
    people: Sequence[str] = ()


ReadItems = Callable[[Fields, Node, CaseNames], Iterator[ExpectedItem]]


def read_expectations(case: Fields, keys: ExpectKeys | None, names: CaseNames) -> tuple[Expectation, ...]:
    """Return the expectations in the section ``expect`` of a case; keys with an invalid value are skipped."""
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
            case.add_error(node.mark, f"'{key.word}' has no names")
    if not expect.entries:
        case.add_error(expect.mark, "no expectation", "write expect: {result: success}")
    return tuple(found)


def _read_texts(node: Node) -> Iterator[ExpectedItem]:
    """Yield an item for each text that a key of ``expect`` lists, or for its single text."""
    for item in _scalars(node):
        yield ExpectedItem(item.mark, item.text)


def _read_heard_by(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    """Read ``{Anna: [a text], Ben: []}``: yield a name and the texts that this person hears; empty for nothing."""
    for name, texts in _entries(node):
        if names.people and name.text not in names.people:
            fields.add_error(
                name.mark, f"no person is named {quoted_value(name.text)}", suggest_from(name.text, names.people)
            )
        yield ExpectedItem(name.mark, (name.text, tuple(text.text for text in _scalars(texts))))


def _read_nodes(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    for item in _scalars(node):
        _check_node(fields, item, names)
        yield ExpectedItem(item.mark, item.text)


def _read_counts(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    """Read ``{gesture: 2}`` or a list of names: yield a name and a count, None for any count."""
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
    """Yield reflexes, with or without a detail: ``bumper``, ``bumper left``."""
    for item in _scalars(node):
        name = item.text.split()[0]
        if name not in REFLEXES:
            fields.add_error(
                item.mark,
                f"unknown reflex {quoted_value(name)}: it is one of {', '.join(REFLEXES)}",
                suggest_from(name, REFLEXES),
            )
        yield ExpectedItem(item.mark, item.text)


def _read_pose(fields: Fields, node: Node, _: CaseNames) -> Iterator[ExpectedItem]:
    pose = Fields(fields.source, node, fields.diagnostics, subject="'pose'")
    keys = read_keys(pose, PoseKeys)
    turned = pose.node_of("heading")
    heading, askew = (
        (None, HEADING_TOLERANCE) if turned is None else _read_angle(pose, "heading", turned, HEADING_TOLERANCE)
    )
    yield ExpectedItem(node.mark, PoseTarget(*keys.near, keys.within, heading, askew))


def _read_joints(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    """Yield the expected joint angles as (joint name, angle, tolerance), in radians."""
    for name, angle in _entries(node):
        if name.text in names.joints:
            yield ExpectedItem(name.mark, (name.text, *_read_angle(fields, name.text, angle, JOINT_TOLERANCE)))
        else:
            hint = suggest_from(name.text, names.joints) or "the mission uses no arm"
            fields.add_error(name.mark, f"the robot has no joint {quoted_value(name.text)}", hint)


def _read_angle(fields: Fields, key: str, node: Node, default_tolerance: float) -> tuple[float, float]:
    """Read ``90 deg`` or ``90 deg +- 5 deg``; the tolerance may be omitted."""
    text = node.text if isinstance(node, Scalar) else ""
    middle, sign, either = (part.strip() for part in re.split(r"(\+-|±|$)", text, maxsplit=1))
    try:
        return si_value(middle, "angle"), si_value(either, "angle") if sign else default_tolerance
    except ValueError as error:
        fields.add_error(node.mark, f"'{key}' {error}", f"write '{key}: 90 deg +- 5 deg'")
        return 0.0, default_tolerance


def _read_returns(fields: Fields, node: Node, names: CaseNames) -> Iterator[ExpectedItem]:
    for name, value in _entries(node):
        if names.returns is not None and name.text not in names.returns:
            hint = suggest_from(name.text, names.returns) or "it has no results"
            fields.add_error(name.mark, f"the mission returns no {quoted_value(name.text)}", hint)
        else:
            yield ExpectedItem(name.mark, (name.text, plain_data(value)))


def _check_node(fields: Fields, name: Scalar, names: CaseNames) -> None:
    problem = names.node_error(name.text)
    if problem:
        fields.add_error(name.mark, problem)


def _scalars(node: Node) -> list[Scalar]:
    """Return the texts of a YAML list, or a single text as a list."""
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
"""Readers of the keys of ``expect`` whose values depend on the case; other values are used as they are."""
