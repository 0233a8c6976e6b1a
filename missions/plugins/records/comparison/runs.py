"""Compare two runs of one mission: the first different decision, and statistics of both runs.

Decisions are compared node by node: each node must have the same sequence of statuses in both runs, at any times. So a
leaf that takes longer is no difference; a leaf with another result is one.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from math import dist
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from missions.executive.events import Ended, NodeChanged
from missions.plugins.records.recording.run_record import RunRecord
from missions.plugins.records.replay.status_comparison import NodePlace, node_places, pair_nodes
from missions.plugins.records.report.joints import PHYSICS_OPTION, JointFigures
from missions.plugins.records.report.summary import RecordStudy, study_record
from missions.plugins.records.report.traces import BaseRoute
from missions.trees.drawing import TreeBox

DISTANCE_SAMPLES = 2000
"""Number of times at which the distance between the bases of the two runs is sampled."""


T = TypeVar("T")


class IncomparableError(ValueError):
    """Two runs that cannot be compared; the message has the reason."""


class RunPair(NamedTuple, Generic[T]):
    """The values of one quantity in both runs, ``a`` and ``b``; None if a run lacks the quantity."""

    a: T | None
    b: T | None


@dataclass(frozen=True, slots=True)
class FirstDifference:
    """The first different decision: a node of the behaviour tree, and its status change in each run."""

    place: NodePlace
    changes: RunPair[NodeChanged]


@dataclass(frozen=True, slots=True)
class LeafComparison:
    """A leaf that ran in at least one of the runs: number of times, and total running time (s) in each run."""

    place: NodePlace
    runs: RunPair[int]
    seconds: RunPair[float]


@dataclass(frozen=True, slots=True)
class BasePath:
    """Path of a base: length (m), total rotation (rad), and final x, y (m) and heading (rad)."""

    length: float
    turned: float
    end: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class RunComparison:
    """Comparison of two runs of one mission on one robot.

    ``nodes`` is the number of nodes in both trees. ``settings`` are those settings that differ between the runs.
    ``max_distance`` is the largest distance (m) between the bases at the same time since the first tick, and this time
    (s).
    """

    a: RecordStudy
    b: RecordStudy
    nodes: int
    settings: Mapping[str, RunPair[str]]
    first_difference: FirstDifference | None
    ends: RunPair[Ended]
    leaves: Sequence[LeafComparison]
    joints: Mapping[str, RunPair[JointFigures]]
    paths: RunPair[BasePath]
    max_distance: tuple[float, float] | None


def compare_runs(one: RunRecord, other: RunRecord) -> RunComparison:
    """Compare two runs. Raises IncomparableError if they are of different missions or robots.

    Raises InvalidRecordError for an unreadable record.
    """
    for field in ("mission", "robot"):
        names = getattr(one.header, field), getattr(other.header, field)
        if names[0] != names[1]:
            message = f"{one.path} is of the {field} '{names[0]:.60}', {other.path} of '{names[1]:.60}'"
            raise IncomparableError(f"{message}: only runs of one mission on one robot can be compared")
    a, b = study_record(one), study_record(other)
    places = {place.key: place for place in node_places(a.drawing)}
    pairs = pair_nodes(tuple(places.values()), node_places(b.drawing))
    if not pairs:
        raise IncomparableError(f"the trees of {one.path} and {other.path} have no node in common")
    return RunComparison(
        a,
        b,
        len(pairs),
        dict(_differing_settings(one, other)),
        _find_first_difference(_changes(one), _changes(other), places, pairs),
        RunPair(one.run_end(), other.run_end()),
        list(_compare_leaves(a, b, places, pairs)),
        _pair_joints(a.joints, b.joints),
        RunPair(_base_path(a.route), _base_path(b.route)),
        _find_max_distance(a, b),
    )


def _differing_settings(one: RunRecord, other: RunRecord) -> Iterator[tuple[str, RunPair[str]]]:
    """Yield the name and both values of each setting, param and file that differs between the runs."""
    heads = one.header, other.header
    for word in ("world", "simulate", "eyes", "seed", "rate"):
        values = [str(getattr(head, word)) for head in heads]
        if values[0] != values[1]:
            yield word, RunPair(*values)
    physics = ["yes" if PHYSICS_OPTION in head.command else "no" for head in heads]
    if physics[0] != physics[1]:
        yield "physics", RunPair(*physics)
    for name in dict.fromkeys((*heads[0].values, *heads[1].values)):
        pair = RunPair(*(head.values.get(name) for head in heads))
        if pair.a != pair.b:
            yield name, pair
    for name in sorted({*one.files, *other.files}):
        files = [record.files.get(name) for record in (one, other)]
        if files[0] != files[1]:
            yield name, RunPair(*(None if data is None else f"{len(data)} bytes" for data in files))


def _changes(record: RunRecord) -> list[NodeChanged]:
    return [event for event in record.events if isinstance(event, NodeChanged)]


def _find_first_difference(
    one: Iterable[NodeChanged], other: Iterable[NodeChanged], places: Mapping[str, NodePlace], pairs: Mapping[str, str]
) -> FirstDifference | None:
    """Return the first status change that differs between two runs.

    If several changes differ in the same tick, the most likely cause of the others is returned.
    """
    order = {key: number for number, key in enumerate(places)}
    a, b = _changes_by_node(one), _changes_by_node(other)
    differences = []
    for key, other_key in pairs.items():
        became = next(
            (RunPair(*two) for two in zip_longest(a[key], b[other_key]) if _status(two[0]) != _status(two[1])), None
        )
        if became is not None:
            differences.append(FirstDifference(places[key], became))

    def rank(split: FirstDifference) -> tuple[float, bool, bool, int]:
        """Return the sort key of a difference between the runs, of which the smallest is the likely cause.

        The earliest difference comes first. At one time, nodes that did more than halt come first, then leaves, then
        the order of the tree.
        """
        changes = [change for change in split.changes if change is not None]
        halted = all(change.status == "idle" for change in changes)
        return min(change.t for change in changes), halted, not split.place.is_leaf, order[split.place.key]

    return min(differences, key=rank, default=None)


def _changes_by_node(changes: Iterable[NodeChanged]) -> Mapping[str, list[NodeChanged]]:
    """Return the status changes of each node, in order, without repeated statuses."""
    changes_by_node: defaultdict[str, list[NodeChanged]] = defaultdict(list)
    for change in changes:
        if not changes_by_node[change.node] or changes_by_node[change.node][-1].status != change.status:
            changes_by_node[change.node].append(change)
    return changes_by_node


def _status(change: NodeChanged | None) -> str | None:
    return None if change is None else change.status


def _compare_leaves(
    a: RecordStudy, b: RecordStudy, places: Mapping[str, NodePlace], pairs: Mapping[str, str]
) -> Iterator[LeafComparison]:
    """Yield the leaves that ran in at least one of the runs, in the order of the first tree."""
    lanes = [{lane.box.key: lane for lane in found.lanes} for found in (a, b)]
    back = {new: old for old, new in pairs.items()}
    here = {**{key: (key, pairs.get(key)) for key in places}, **_nodes_of_second_tree(b.drawing.root, back)}
    for key, (mine, other_key) in here.items():
        two = lanes[0].get(mine or ""), lanes[1].get(other_key or "")
        box: TreeBox | None = next((lane.box for lane in two if lane is not None), None)
        if box is not None:
            place = places.get(key) or NodePlace(key, box.kind, box.name, box.file, box.line, is_leaf=True)
            goes = RunPair(*(None if lane is None else sum(bar.count for bar in lane.bars) for lane in two))
            yield LeafComparison(place, goes, RunPair(*(None if lane is None else lane.busy_seconds for lane in two)))


def _nodes_of_second_tree(root: TreeBox, back: Mapping[str, str]) -> Mapping[str, tuple[None, str]]:
    """Return the nodes that only the second tree has, each as (None, key), by a label such as "b 1.2".

    The label differs from all keys of the first tree.
    """
    return {f"b {box.key}": (None, box.key) for box in root.walk() if box.key not in back}


def _pair_joints(one: Sequence[JointFigures], other: Sequence[JointFigures]) -> dict[str, RunPair[JointFigures]]:
    a, b = ({each.name: each for each in joints} for joints in (one, other))
    return {name: RunPair(a.get(name), b.get(name)) for name in (*a, *(name for name in b if name not in a))}


def _base_path(route: BaseRoute) -> BasePath | None:
    return BasePath(route.length, route.rotation, route.poses[-1]) if route.poses else None


def _find_max_distance(a: RecordStudy, b: RecordStudy) -> tuple[float, float] | None:
    """Return the largest distance (m) between the bases at the same time, and this time (s); None without two paths.

    The position of each base is relative to its start.
    """
    if not (a.route.times and b.route.times):
        return None
    both = [(np.asarray(found.route.times) - found.slider.start, np.asarray(found.route.poses)) for found in (a, b)]
    begin, end = max(times[0] for times, _ in both), min(times[-1] for times, _ in both)
    if begin > end:
        return None
    looks = np.linspace(begin, end, DISTANCE_SAMPLES)
    x, y = (
        np.subtract(*(np.interp(looks, times, places[:, axis] - places[0, axis]) for times, places in both))
        for axis in (0, 1)
    )
    far = np.hypot(x, y)
    worst = int(far.argmax())
    return float(far[worst]), float(looks[worst])


def end_distance(one: BasePath, other: BasePath) -> float:
    """Return the distance (m) between the final positions of two paths of a base."""
    return dist(one.end[:2], other.end[:2])
