"""What two runs of one mission have in common: where their trees first decide differently, and all that can be counted.

Decisions are compared node by node: what each became, in turn, whenever that was. So a leaf that takes longer in one of
the runs makes no difference, but one that ends otherwise does.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from math import dist
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from missions.executive.events import Ended, NodeChanged
from missions.plugins.records.recording.read import Record
from missions.plugins.records.replay.compare import Place, paired, places_of
from missions.plugins.records.report.joints import PHYSICS, JointFigures
from missions.plugins.records.report.summary import Study, study
from missions.plugins.records.report.traces import Route
from missions.trees.drawing import Box

APART_EVERY = 2000
"""At most so many times are looked at for how far two ways were apart."""


T = TypeVar("T")


class IncomparableError(ValueError):
    """Two runs that have nothing to compare; says why."""


class Pair(NamedTuple, Generic[T]):
    """The same of either run; None where it is in one only, or not known."""

    a: T | None
    b: T | None


@dataclass(frozen=True, slots=True)
class Split:
    """Where the trees first decide differently: a node, its place, and what it became in either run."""

    place: Place
    became: Pair[NodeChanged]


@dataclass(frozen=True, slots=True)
class Leaf:
    """A leaf in both runs: how often it was at work, and for how long in all (s)."""

    place: Place
    goes: Pair[int]
    seconds: Pair[float]


@dataclass(frozen=True, slots=True)
class Way:
    """How far a base drove (m) and turned (rad), and where it was in the end: x, y (m) and heading (rad)."""

    length: float
    turned: float
    end: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two runs of one mission on one robot, side by side.

    ``settings`` are what they were run with, as far as it differs; ``nodes`` says how many nodes are in both trees.
    ``apart`` is how far their bases were apart at most at the same time since the first tick (m), and when (s).
    """

    a: Study
    b: Study
    nodes: int
    settings: Mapping[str, Pair[str]]
    split: Split | None
    ends: Pair[Ended]
    leaves: Sequence[Leaf]
    joints: Mapping[str, Pair[JointFigures]]
    ways: Pair[Way]
    apart: tuple[float, float] | None


def compared(one: Record, other: Record) -> Comparison:
    """Compare two runs. Raises IncomparableError for other missions or robots, InvalidRecordError."""
    for what in ("mission", "robot"):
        names = getattr(one.head, what), getattr(other.head, what)
        if names[0] != names[1]:
            told = f"{one.path} is of the {what} '{names[0]:.60}', {other.path} of '{names[1]:.60}'"
            raise IncomparableError(f"{told}: only runs of one mission on one robot can be compared")
    a, b = study(one), study(other)
    places = {place.key: place for place in places_of(a.drawing)}
    pairs = paired(tuple(places.values()), places_of(b.drawing))
    if not pairs:
        raise IncomparableError(f"the trees of {one.path} and {other.path} have no node in common")
    return Comparison(
        a,
        b,
        len(pairs),
        dict(_settings(one, other)),
        _split(_changes(one), _changes(other), places, pairs),
        Pair(one.end(), other.end()),
        list(_leaves(a, b, places, pairs)),
        _joints(a.joints, b.joints),
        Pair(_way(a.route), _way(b.route)),
        _apart(a, b),
    )


def _settings(one: Record, other: Record) -> Iterator[tuple[str, Pair[str]]]:
    """Yield what the runs were made of, where it is not the same."""
    heads = one.head, other.head
    for word in ("world", "simulate", "eyes", "seed", "rate"):
        values = [str(getattr(head, word)) for head in heads]
        if values[0] != values[1]:
            yield word, Pair(*values)
    physics = ["yes" if PHYSICS in head.command else "no" for head in heads]
    if physics[0] != physics[1]:
        yield "physics", Pair(*physics)
    for name in dict.fromkeys((*heads[0].values, *heads[1].values)):
        pair = Pair(*(head.values.get(name) for head in heads))
        if pair.a != pair.b:
            yield name, pair
    for name in sorted({*one.files, *other.files}):
        files = [record.files.get(name) for record in (one, other)]
        if files[0] != files[1]:
            yield name, Pair(*(None if data is None else f"{len(data)} bytes" for data in files))


def _changes(record: Record) -> list[NodeChanged]:
    return [event for event in record.events if isinstance(event, NodeChanged)]


def _split(
    one: Iterable[NodeChanged], other: Iterable[NodeChanged], places: Mapping[str, Place], pairs: Mapping[str, str]
) -> Split | None:
    """Return the earliest of all differences; of several in one tick, the likeliest cause."""
    order = {key: number for number, key in enumerate(places)}
    a, b = _by_node(one), _by_node(other)
    found = []
    for key, its in pairs.items():
        became = next((Pair(*two) for two in zip_longest(a[key], b[its]) if _status(two[0]) != _status(two[1])), None)
        if became is not None:
            found.append(Split(places[key], became))

    def rank(split: Split) -> tuple[float, bool, bool, int]:
        """Put first what came first; then what was not only halted, leaves, and what stands further up."""
        changes = [change for change in split.became if change is not None]
        halted = all(change.status == "idle" for change in changes)
        return min(change.t for change in changes), halted, not split.place.is_leaf, order[split.place.key]

    return min(found, key=rank, default=None)


def _by_node(changes: Iterable[NodeChanged]) -> Mapping[str, list[NodeChanged]]:
    """Return what each node became in turn, without news that are none."""
    found: defaultdict[str, list[NodeChanged]] = defaultdict(list)
    for change in changes:
        if not found[change.node] or found[change.node][-1].status != change.status:
            found[change.node].append(change)
    return found


def _status(change: NodeChanged | None) -> str | None:
    return None if change is None else change.status


def _leaves(a: Study, b: Study, places: Mapping[str, Place], pairs: Mapping[str, str]) -> Iterator[Leaf]:
    """Yield the leaves that were at work in one of the runs at least, in the order of the first tree."""
    lanes = [{lane.box.key: lane for lane in found.lanes} for found in (a, b)]
    back = {new: old for old, new in pairs.items()}
    here = {**{key: (key, pairs.get(key)) for key in places}, **_only_there(b.drawing.root, back)}
    for key, (mine, its) in here.items():
        two = lanes[0].get(mine or ""), lanes[1].get(its or "")
        box: Box | None = next((lane.box for lane in two if lane is not None), None)
        if box is not None:
            place = places.get(key) or Place(key, box.kind, box.name, box.file, box.line, is_leaf=True)
            goes = Pair(*(None if lane is None else sum(bar.count for bar in lane.bars) for lane in two))
            yield Leaf(place, goes, Pair(*(None if lane is None else lane.busy for lane in two)))


def _only_there(root: Box, back: Mapping[str, str]) -> Mapping[str, tuple[None, str]]:
    """Return the nodes that the second tree has alone."""
    return {f"b {box.key}": (None, box.key) for box in root.walk() if box.key not in back}


def _joints(one: Sequence[JointFigures], other: Sequence[JointFigures]) -> dict[str, Pair[JointFigures]]:
    a, b = ({each.name: each for each in joints} for joints in (one, other))
    return {name: Pair(a.get(name), b.get(name)) for name in (*a, *(name for name in b if name not in a))}


def _way(route: Route) -> Way | None:
    return Way(route.length, route.turned, route.places[-1]) if route.places else None


def _apart(a: Study, b: Study) -> tuple[float, float] | None:
    """Return how far the bases were apart at most at one time, each from where it began, and when."""
    if not (a.route.times and b.route.times):
        return None
    both = [(np.asarray(found.route.times) - found.moments.begin, np.asarray(found.route.places)) for found in (a, b)]
    begin, end = max(times[0] for times, _ in both), min(times[-1] for times, _ in both)
    if begin > end:
        return None
    looks = np.linspace(begin, end, APART_EVERY)
    x, y = (
        np.subtract(*(np.interp(looks, times, places[:, axis] - places[0, axis]) for times, places in both))
        for axis in (0, 1)
    )
    far = np.hypot(x, y)
    worst = int(far.argmax())
    return float(far[worst]), float(looks[worst])


def distance(one: Way, other: Way) -> float:
    """Return how far apart two ways ended (m)."""
    return dist(one.end[:2], other.end[:2])
