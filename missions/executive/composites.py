"""The composites of the mission language, as py_trees composites that halt what runs before something else starts."""

from collections.abc import Mapping
from typing import ClassVar

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.node import Node
from behaviours.suspension import Suspension
from missions.executive.at_once import Parallel, Race
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Composite
from missions.executive.reactive import ReactiveSelector, ReactiveSequence


class InOrder(Composite):
    """One child after another, resuming at the running one.

    ``passes`` is the status that leads to the next; ``order`` the children in this run's order.
    """

    run_state = ("_index", "order", "_lost")
    passes: ClassVar[Status]
    order: tuple[Node, ...] = ()
    _index = 0
    _lost: Suspension | None = None  # that of a child that has failed for it
    current_child: Behaviour | None

    def begin(self) -> None:
        self._index = 0
        self._lost = None
        self.order = self.members

    def on_running(self) -> Status:
        order, passes, index = self.order, self.passes, self._index
        last = len(order) - 1
        while True:
            child = order[index]
            status = child.on_tick()
            if status is not child.status:  # as ``execute_tick`` does, without the call
                child.publish(status)
            if status is not passes or index == last:
                break
            if child.suspension is not None:
                self._lost = child.suspension
            index += 1
        self._index = index
        self.current_child = child
        if status is RUNNING:
            self.suspension = child.suspension
        return self._blame_last(child) if status is FAILURE else status

    def _blame_last(self, child: Node) -> Status:
        """Return a failure for the reason of ``child``; it is for a silent sensor if that of any child was."""
        self.blame(child)
        if self.suspension is None and self.passes is FAILURE:
            self.suspension = self._lost
        return FAILURE

    def member_ended(self, member: Node, status: Status) -> Status:
        if status is not self.passes or self._index == len(self.order) - 1:
            return super().member_ended(member, status)
        self._lost = self._lost or member.suspension
        self._index += 1  # the next child starts with the next tick
        return RUNNING


class Sequence(InOrder, composites.Sequence):
    """Does its children one after another; fails at the first failure."""

    passes = SUCCESS

    def __init__(self, name: str) -> None:
        composites.Sequence.__init__(self, name, memory=True)


class Selector(InOrder, composites.Selector):
    """Tries its children one after another until one succeeds."""

    passes = FAILURE

    def __init__(self, name: str) -> None:
        composites.Selector.__init__(self, name, memory=True)


class RandomOrder(InOrder):
    """One child after another, in an order drawn afresh at each start from the mission's own seed."""

    def begin(self) -> None:
        super().begin()
        order = list(self.members)
        self.run.random.shuffle(order)
        self.order = tuple(order)


class RandomSequence(RandomOrder, composites.Sequence):
    """A sequence in an order drawn afresh at each start."""

    passes: ClassVar[Status] = SUCCESS

    def __init__(self, name: str) -> None:
        composites.Sequence.__init__(self, name, memory=True)


class RandomSelector(RandomOrder, composites.Selector):
    """A selector in an order drawn afresh at each start."""

    passes: ClassVar[Status] = FAILURE

    def __init__(self, name: str) -> None:
        composites.Selector.__init__(self, name, memory=True)


COMPOSITES: Mapping[str, type[Composite]] = {
    "sequence": Sequence,
    "reactive_sequence": ReactiveSequence,
    "selector": Selector,
    "reactive_selector": ReactiveSelector,
    "parallel": Parallel,
    "race": Race,
    "random_sequence": RandomSequence,
    "random_selector": RandomSelector,
}
"""The composites with a list of children, by their words."""
