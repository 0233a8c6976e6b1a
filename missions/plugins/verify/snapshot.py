"""Snapshots of a model's nodes and variables: hashable, and equal if the model goes on in the same way."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, NamedTuple

from behaviours.leaf import FAILURE, IDLE, RUNNING, SUCCESS
from behaviours.node import Node, Suspension
from missions.executive.for_each import ForEach
from missions.executive.modifiers import (
    MAX_RETICK_INTERVAL,
    CooldownModifier,
    FinallyModifier,
    OnceModifier,
    RepeatModifier,
    RetryModifier,
)
from missions.executive.parallel import Parallel
from missions.executive.parent import Modifier
from missions.plugins.verify.abstract_values import PLAIN_TYPES, UnboundedCount
from missions.plugins.verify.stand_ins import StandIn
from missions.plugins.verify.symbolic_time import Instant, SymbolicClock

Row = tuple[Any, ...]
Rows = tuple[int, ...]
"""State of all nodes: for each node the number of its row, under which ``Snapshots`` stores the row itself.

A row has the node's status, as an index of STATUSES, and its relevant fields.
"""

STATUSES = (IDLE, RUNNING, SUCCESS, FAILURE, SUCCESS)

SKIPPED_INDEX = 4
"""Index in STATUSES of the status of a child of a parallel that was skipped."""


class ZoneInstant(NamedTuple):
    """Instant in a state: its index in the zone (the time bounds of the state), plus an offset in seconds."""

    place: int
    offset: float


UNKNOWN_INSTANT = ZoneInstant(-1, 0.0)
"""Placeholder for an instant from which a node waits for an unknown time: every comparison with it is a choice."""


@dataclass(frozen=True, slots=True)
class NodeFields:
    """Fields of one node in a snapshot: their names, and their values at rest.

    - ``own`` is the node's own namespace, which always has all of the ``names``.
    - ``lasting`` gets from it the fields that last beyond a run; ``initial`` are their initial values.
    - ``resting_rows`` caches the row numbers of a node at rest with initial values, by status index.
    - ``running_rows`` caches those of a running node, by status index and values. In most states, most nodes have a
      cached row.
    - ``is_counted`` is true for a child of a parallel, which counts skipped children separately.
    """

    node: Node
    parent: int | None
    is_counted: bool
    own: dict[str, Any]
    names: tuple[str, ...]
    at_rest: tuple[tuple[bool, object], ...]
    lasting: Callable[[Mapping[str, object]], object]
    initial: object
    values: Callable[[Mapping[str, object]], object]
    resting_rows: dict[int, int] = field(default_factory=dict)
    running_rows: dict[tuple[int, object], int] = field(default_factory=dict)

    @classmethod
    def of(cls, node: Node, parent: int | None) -> "NodeFields":
        """Return the fields of ``node``, with its present values as initial ones; ``parent`` is its parent's index."""
        is_counted = isinstance(node.parent, Parallel)
        running, lasting = declared_state(type(node))
        names = tuple(name for name in sorted(running | lasting) if name != "result" or not _recomputes_result(node))
        at_rest = tuple((name in lasting, getattr(node, name)) for name in names)
        own = vars(node)
        own |= {"suspension": None, "is_skipped": False}
        own.update(zip(names, (value for _, value in at_rest), strict=True))
        lasts = _getter([name for name in names if name in lasting])
        return cls(node, parent, is_counted, own, names, at_rest, lasts, lasts(own), _getter(names))


def _getter(names: Sequence[str]) -> Callable[[Mapping[str, object]], object]:
    """Return a function that gets the values of ``names`` from a mapping."""
    return itemgetter(*names) if names else lambda _: None


class Snapshots:
    """Saves and restores the relevant fields of ``nodes``, the nodes of a tree that has not begun."""

    def __init__(self, nodes: Sequence[Node], timing: SymbolicClock) -> None:
        self._timing = timing
        parents = {child: place for place, node in enumerate(nodes) for child in node.children}
        self._parts = [NodeFields.of(node, parents.get(node)) for node in nodes]
        self._numbers: dict[tuple[tuple[str, ...], Row], int] = {}
        self._rows: list[dict[str, object]] = []  # fields by row number
        self._stopping = [part.own for part in self._parts if isinstance(part.node, StandIn | FinallyModifier)]

    def take(self, ticking: Collection[int] = ()) -> tuple[Rows, dict[int, float]]:
        """Return the rows of all nodes, and the instants in these rows, each with the longest wait from it in seconds.

        An instant is an index in the zone, the time bounds of the state; a row refers to it by its position in the
        returned mapping. ``ticking`` are the indices of nodes whose tick has begun and not ended; they count as
        running.
        """
        instants: dict[int, float] = {}
        running: list[bool] = []
        rows = []
        for number, part in enumerate(self._parts):
            runs = part.node.status is RUNNING or number in ticking
            running.append(runs)
            # The end status of a node matters only while its parent runs.
            known = runs or part.parent is None or running[part.parent]
            place = _status_index(part) if known else 0
            if runs:
                rows.append(self._running_row(part, place, instants))
                continue
            if part.lasting(part.own) != part.initial:
                rows.append(self._row(part, place, instants, runs=False))
                continue
            if place not in part.resting_rows:
                part.resting_rows[place] = self._row(part, place, instants, runs=False)
            rows.append(part.resting_rows[place])
        return tuple(rows), instants

    def marks(self, ticking: Collection[int]) -> tuple[tuple[int, bool | None, bool], ...]:
        """Return the nodes that were suspended or skipped in this tick, as tuples of three.

        Each tuple has the index of the node, whether its suspension has timed out (None if it is not suspended), and
        whether it was skipped. Nodes in ``ticking``, whose tick has not ended, and nodes whose parent does not run are
        left out: only a running parent reads these facts.
        """
        found = []
        for number, part in enumerate(self._parts):
            suspension, is_skipped = part.own["suspension"], part.own["is_skipped"]
            if (suspension is None and not is_skipped) or number in ticking or part.parent is None:
                continue
            if part.parent in ticking or self._parts[part.parent].node.status is RUNNING:
                found.append((number, None if suspension is None else suspension.timed_out, is_skipped))
        return tuple(found)

    def stopped_in(self, tick: int) -> tuple[bool, ...]:
        """Return for each leaf, and each ``finally``, whether it is stopping and was halted in the tick ``tick``.

        For a ``finally``, that means that its cleanup was ticked.
        """
        return tuple(
            tick in (own.get("_halt_tick"), own.get("_cleanup_tick"))
            and (own.get("_halt_by") is not None or own.get("_cleanup_since") is not None)
            for own in self._stopping
        )

    def _running_row(self, part: NodeFields, place: int, instants: dict[int, float]) -> int:
        """Return the number of the row of a node that runs."""
        values = part.values(part.own)
        if any(type(value) is Instant for value in (values if type(values) is tuple else (values,))):
            return self._row(part, place, instants, runs=True)  # equal instants may be different ones
        try:
            return part.running_rows[place, values]
        except KeyError:
            found = part.running_rows[place, values] = self._row(part, place, instants, runs=True)
            return found

    def _row(self, part: NodeFields, place: int, instants: dict[int, float], *, runs: bool) -> int:
        """Return the number of a node's present row; ``place`` is the index of the node's status.

        ``runs`` tells whether the node runs. Instants in the row are added to ``instants``.
        """
        node = part.node
        row: list[object] = [place]
        for name, (lasts, at_rest) in zip(part.names, part.at_rest, strict=True):
            value = getattr(node, name) if runs or lasts else at_rest
            if isinstance(node, CooldownModifier) and self._is_over(node, name, value):
                value = at_rest
            row.append(value if value is None or value is at_rest else _row_value(value, node, name, instants))
        return self._number(tuple(row), part.names)

    def _is_over(self, node: CooldownModifier, name: str, value: object) -> bool:
        """Return whether a time of a cooldown is certainly over: it then has the same future as one not begun."""
        if name != "_succeeded_at" or not isinstance(value, Instant):
            return False
        wait = _wait_seconds(node, name)
        return wait is not None and self._timing.zone.is_over(value.place, wait)

    def _number(self, row: Row, names: tuple[str, ...]) -> int:
        """Return the number of a row. Numbers make the frequent comparisons of states fast."""
        number = self._numbers.get((names, row))
        if number is None:
            number = self._numbers[names, row] = len(self._rows)
            skipped = row[0] == SKIPPED_INDEX
            fields = {"status": STATUSES[row[0]], "is_skipped": skipped, "suspension": None} | dict(
                zip(names, row[1:], strict=True)
            )
            for name, value in fields.items():
                if isinstance(value, ZoneInstant):
                    fields[name] = Instant(self._timing, value.place, value.offset)
            self._rows.append(fields)
        return number

    def restore(self, rows: Rows) -> None:
        """Restore the fields of every node."""
        for part, number in zip(self._parts, rows, strict=True):
            part.own.update(self._rows[number])


def declared_state(kind: type[Node]) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of the attributes that a class and its bases declare as their state.

    The first set is reset when the node ends (``run_state``), the second lasts beyond that (``lasting_state``).
    """
    declared = [vars(each) for each in kind.__mro__]
    running, lasting = (
        frozenset().union(*(each.get(name, ()) for each in declared)) for name in ("run_state", "lasting_state")
    )
    return running, lasting


def _status_index(part: NodeFields) -> int:
    """Return the index of a node's status in STATUSES, by comparison: hashing an enum is slow."""
    status = part.node.status
    if status is RUNNING:
        return 1
    if status is SUCCESS:
        return SKIPPED_INDEX if part.is_counted and part.node.is_skipped else 2
    return 3 if status is FAILURE else 0


def _recomputes_result(node: Node) -> bool:
    """Return whether a leaf computes its result again at each tick, so that its old result has no effect.

    That holds for all leaves that need no time to stop.
    """
    return isinstance(node, StandIn) and not node.lingers


def _row_value(value: object, node: Node, name: str, instants: dict[int, float]) -> object:
    """Return a value as a row stores it: an instant by its number, a count only up to a maximum.

    A maximum is needed only for loops whose number of repetitions is not known. There, all counts from the maximum on
    have the same effect.
    """
    if isinstance(value, Instant):
        wait = _wait_seconds(node, name)
        if wait is None:
            return UNKNOWN_INSTANT
        instants[value.place] = max(instants.get(value.place, 0.0), wait + value.offset)
        return ZoneInstant(list(instants).index(value.place), value.offset)
    if isinstance(node, OnceModifier) and isinstance(value, tuple):
        status, _, setting = value  # the reason between them has no effect
        return status, "", setting
    if isinstance(value, Suspension):
        return replace(value, reason="")
    if isinstance(value, tuple):
        return tuple(_row_value(each, node, name, instants) for each in value)
    if type(value) is int and isinstance(node, RetryModifier | RepeatModifier | ForEach) and name != "setting":
        return value if type(_rounds(node)) is int else min(value, _max_count(node))
    return value


def _wait_seconds(node: Node, name: str) -> float | None:
    """Return how long ``node`` waits from a stored instant on; None if that is known only at its start.

    A suspended node waits for the sensor timeout. After a `timeout` around a suspended node has failed, its wait is
    ``MAX_RETICK_INTERVAL``. Other modifiers wait for the duration in the mission. A leaf stores the end of its wait, so
    the result for a leaf is 0.
    """
    if name == "_silent_since":
        return node.run.sensor_timeout
    if name == "gave_up":
        return MAX_RETICK_INTERVAL
    if not isinstance(node, Modifier):
        return 0.0
    seconds: Any = node.value.constant
    return seconds if node.value.template is None else None


def _rounds(node: RetryModifier | RepeatModifier | ForEach) -> object:
    """Return how often a node repeats its child; None for ever."""
    return node.setting.count if isinstance(node, ForEach) else node.setting


def _max_count(node: RetryModifier | RepeatModifier | ForEach) -> int:
    """Return the largest number of repetitions that a state stores: larger numbers have the same effect."""
    rounds = _rounds(node)
    return rounds.min_rounds if isinstance(rounds, UnboundedCount) else 0


class FrozenValue(NamedTuple):
    """Frozen value of a variable: its type, since 1 equals true, and its value, with lists and mappings as tuples."""

    kind: type
    value: object


def freeze(scope: Mapping[str, object]) -> Row:
    """Return the variables of a scope in a hashable form, so that states can be compared."""
    return tuple((name, _freeze_value(scope[name])) for name in sorted(scope))


def thaw(row: Iterable[Any]) -> dict[str, object]:
    """Return the variables stored by ``freeze``."""
    return {name: _thaw_value(value) for name, value in row}


def _freeze_value(value: object) -> FrozenValue:
    if type(value) in PLAIN_TYPES:
        return FrozenValue(type(value), value)
    if isinstance(value, Mapping):
        return FrozenValue(dict, freeze(value))
    if isinstance(value, list | tuple):
        return FrozenValue(list, tuple(map(_freeze_value, value)))
    return FrozenValue(type(value), value)


def _thaw_value(frozen: FrozenValue) -> object:
    value: Any = frozen.value
    if frozen.kind is dict:
        return thaw(value)
    return [_thaw_value(each) for each in value] if frozen.kind is list else value
