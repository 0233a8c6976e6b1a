"""Runs that nobody can tell apart: of many of them one is explored, so that a mission with many leaves stays small.

Two cases, both exact. Where a modifier above a leaf takes success and failure for the same, one of the two will do. And
in a ``parallel``, of leaves that keep nothing, wait for nothing and stop at once, it does not matter which ends before
which, since until the parallel ends each of them might as well have gone on: all but the first of them, their
``leader``, go on while it does, and end in the tick in which it has. For every run there is such a run in which each
node around them does the same in the same tick (a partial-order reduction, with one representative of all orders).
"""

from collections.abc import Sequence

from behaviours.leaf import FAILURE, RUNNING, SUCCESS
from behaviours.node import Node
from missions.executive.at_once import Parallel
from missions.executive.modifier import Modifier
from missions.executive.modifiers import Invert, OnFailure, OnSuccess
from missions.testing.verify.mocks import StandIn
from missions.testing.verify.monitors import Following

_SAME = {OnFailure: SUCCESS, OnSuccess: FAILURE}
"""The modifiers for which success and failure are the same, and what they make of both."""


def tell_fewer_apart(nodes: Sequence[Node], monitors: Sequence[Following]) -> None:
    """Let the stand-ins among ``nodes`` leave out what comes to the same, as far as no monitor asks for them."""
    asked = frozenset[Node]().union(*(monitor.subject | monitor.other | monitor.counts for monitor in monitors))
    for node in nodes:
        if type(node) in _SAME:
            leaf = _leaf_of(node, asked)
            if leaf is not None and leaf.keep_as is None:
                leaf.ends_alike = True
    for node in nodes:
        if isinstance(node, Parallel) and not node.counts:
            free = [
                leaf for child in node.members if (leaf := _leaf_of(child, asked)) is not None and _is_free(child, leaf)
            ]
            for leaf in free[1:]:
                leaf.leader = free[0]


def _leaf_of(node: Node, asked: frozenset[Node]) -> StandIn | None:
    """Return the leaf of which ``node`` makes something each time that it ends, and keeps nothing; None if not so."""
    while isinstance(node, Invert | OnFailure | OnSuccess) and node not in asked:
        node = node.child
    return node if type(node).__base__ is StandIn and isinstance(node, StandIn) and node not in asked else None


def _is_free(child: Node, leaf: StandIn) -> bool:
    """Say whether a leaf keeps nothing, stops at once, and may go on as well as end, so that ``child`` succeeds."""
    statuses = {outcome.status for outcome in leaf.outcomes}
    if leaf.sensor:  # it fails by itself once that is silent for too long
        return False
    can = {RUNNING} <= statuses and SUCCESS in {_made_of(child, status) for status in statuses - {RUNNING}}
    return can and leaf.keep_as is None and not (leaf.computed or leaf.lingers) and leaf.stops


def _made_of(node: Node, status: object) -> object:
    """Return what the modifiers from ``node`` on make of the status of the leaf within."""
    if not isinstance(node, Modifier):
        return status
    below = _made_of(node.child, status)
    return _SAME.get(type(node)) or (FAILURE if below is SUCCESS else SUCCESS)
