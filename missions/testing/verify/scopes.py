"""The variables of a mission, and of those inside it, as far as they decide anything yet."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

from behaviours.leaf import RUNNING
from behaviours.node import Node
from missions.executive.build import Scope
from missions.executive.parent import Parent
from missions.executive.submission import Submission
from missions.language.plan import Step
from missions.testing.verify.live import live_while_running
from missions.testing.verify.snapshot import Row, Rows, frozen, thawed


class Scopes:
    """Takes and puts back variables: ``variables`` of the mission itself, whose ``nodes`` were built from ``tree``."""

    def __init__(self, tree: Step, nodes: Sequence[Node], variables: Scope) -> None:
        self._nodes = nodes
        self._scopes = (variables, *(node.inner for node in nodes if isinstance(node, Submission)))
        self._live = live_while_running(tree)
        self._live_in: dict[Rows, tuple[frozenset[str] | None, ...]] = {}

    def take(self, rows: Rows) -> tuple[Row, ...]:
        """Return what is live of each scope; ``rows`` stand for the state that the nodes are in."""
        if rows not in self._live_in:
            self._live_in[rows] = self._live_now()
        each = zip(self._scopes, self._live_in[rows], strict=True)
        return tuple(frozen(scope if live is None else _only(scope, live)) for scope, live in each)

    def put(self, kept: Sequence[Row]) -> None:
        """Give every scope what was taken of it, and nothing else."""
        for scope, row in zip(self._scopes, kept, strict=True):
            scope.clear()
            scope.update(thawed(row))

    def _live_now(self) -> tuple[frozenset[str] | None, ...]:
        """Return the variables of each scope that are live; None for all, before the start and while a halt goes on."""
        halting = any(isinstance(node, Parent) and node.ending is not None for node in self._nodes)
        if halting or self._nodes[0].status is not RUNNING:
            return (None,) * len(self._scopes)
        live: dict[int, set[str]] = defaultdict(set)
        for node in self._nodes:
            if node.status is RUNNING:
                live[id(node.scope)] |= self._live[node.key]
        return tuple(frozenset(live[id(scope)]) for scope in self._scopes)


def _only(scope: Scope, names: frozenset[str]) -> Mapping[str, object]:
    return {name: scope[name] for name in names if name in scope}
