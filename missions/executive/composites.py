"""The composites of the mission language, as py_trees composites that halt what runs before something else starts."""

from collections.abc import Mapping
from collections.abc import Sequence as Many
from typing import ClassVar, Self

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy, Status

from behaviours.node import Node, reset_all
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Parent
from missions.language.counts import Decision, decision
from missions.language.expressions import ExpressionError
from missions.language.plan import Step
from missions.language.values import Value


class Composite(Parent):
    """What all composites share: they forget their children's results when they start."""

    @classmethod
    def of(cls, step: Step, children: Many[Node], inner: dict[str, object]) -> Self:
        del inner
        composite = cls(step.name)
        adopt(composite, children)
        return composite

    def on_start(self) -> str:
        reset_all(self.members)
        self.begin()
        return ""

    def begin(self) -> None:
        """Forget where an earlier run of it was."""


class InOrder(Composite):
    """One child after another, resuming at the running one.

    ``passes`` is the status that leads to the next; ``order`` the children in this run's order.
    """

    run_state = ("_index", "order")
    passes: ClassVar[Status]
    order: tuple[Node, ...] = ()
    _index = 0
    current_child: Behaviour | None

    def begin(self) -> None:
        self._index = 0
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
            index += 1
        self._index = index
        self.current_child = child
        return self.blame(child) if status is FAILURE else status


class _Reactive(Composite):
    """The children from the first at every tick; one that ends the search halts the running one behind it first."""

    run_state = ("_running", "_retiring")
    passes: ClassVar[Status]
    current_child: Behaviour | None
    _running: Node | None = None
    _retiring: Node | None = None

    def begin(self) -> None:
        self._running = self._retiring = None

    def on_running(self) -> Status:
        if not self._retired():
            return RUNNING
        behind = self._running  # the child that runs, while we are still before it
        status = self.passes
        for child in self.members:
            self.current_child = child
            if child is behind:
                behind = None
            status = child.execute_tick() if behind is None else self._tick_before(child, behind)
            if status is not self.passes:
                break
        self._running = child if status is RUNNING else None
        if status is RUNNING:
            return RUNNING
        return self.end(self.blame(child) if status is FAILURE else status)

    def _retired(self) -> bool:
        """True once what gave way at an earlier tick is at rest."""
        if self._retiring is not None and self._retiring.halt():
            self._retiring = None
        return self._retiring is None

    def _tick_before(self, child: Node, behind: Node) -> Status:
        """Tick a child of higher priority than the one that runs; where it takes over, that one is halted first.

        A leaf that is about to drive an actuator halts it before it starts (through ``Run.preempt``). Others show
        only by their status that they take over: it is halted before that status is published.
        """
        preemptible = self.run.preemptible
        preemptible.append(behind)
        try:
            status = child.on_tick()
        finally:
            preemptible.pop()
        if status is not self.passes and not behind.halt():
            self._retiring = behind
        if status is not child.status:
            child.publish(status)
        return status


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


class ReactiveSequence(_Reactive, composites.Sequence):
    """A sequence from the first child at every tick."""

    passes = SUCCESS

    def __init__(self, name: str) -> None:
        composites.Sequence.__init__(self, name, memory=False)


class ReactiveSelector(_Reactive, composites.Selector):
    """A selector from the first child at every tick."""

    passes = FAILURE

    def __init__(self, name: str) -> None:
        composites.Selector.__init__(self, name, memory=False)


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


class Parallel(Composite, composites.Parallel):
    """Does its children all at once until enough have ended (see missions.language.counts), then halts the rest.

    With no ``counts`` beside it, it succeeds when all have, and fails at the first failure.
    """

    run_state = ("_decision",)
    _decision = Decision(1, 1)

    def __init__(self, name: str) -> None:
        composites.Parallel.__init__(self, name, policy=ParallelPolicy.SuccessOnAll(synchronise=True))
        self.counts: Mapping[str, Value] = {}

    @classmethod
    def of(cls, step: Step, children: Many[Node], inner: dict[str, object]) -> Self:
        parallel = super().of(step, children, inner)
        parallel.counts = step.arguments
        return parallel

    def on_start(self) -> str:
        super().on_start()
        settings = {}
        for word, value in self.counts.items():
            try:
                settings[word] = value.resolve(self.scope)
            except (ExpressionError, ValueError) as error:
                return f"{word}: {error}"
        self._decision = decision(len(self.members), settings)
        return ""

    def on_running(self) -> Status:
        # Children that ended at an earlier tick count before any is ticked, wherever they stand in the list.
        statuses = [child.status for child in self.members]
        succeeded, failed = statuses.count(SUCCESS), statuses.count(FAILURE)
        for child, before in zip(self.members, statuses, strict=True):
            if before is SUCCESS or before is FAILURE:
                continue
            status = child.execute_tick()
            if status is RUNNING:
                continue
            succeeded += status is SUCCESS
            failed += status is FAILURE
            if succeeded + failed == len(self.members) or not self._decision.waits:
                if failed >= self._decision.failures:
                    return self.end(self._blame_all(failed))
                if succeeded >= self._decision.successes:
                    return self.end(SUCCESS)
        return RUNNING

    def _blame_all(self, failed: int) -> Status:
        """Return a failure, for the reasons of all that have failed."""
        reasons = [child.feedback_message for child in self.members if child.status is FAILURE]
        number = f"{failed} of {len(self.members)} failed: " if failed > 1 else ""
        self.feedback_message = number + "; ".join(dict.fromkeys(reasons))
        return FAILURE


class Race(Composite, composites.Parallel):
    """Does its children all at once; ends with the first that ends, halting the rest."""

    def __init__(self, name: str) -> None:
        composites.Parallel.__init__(self, name, policy=ParallelPolicy.SuccessOnOne())

    def on_running(self) -> Status:
        for child in self.members:
            status = child.execute_tick()
            if status is not RUNNING:
                return self.end(self.blame(child) if status is FAILURE else status)
        return RUNNING


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


def adopt(parent: Composite, children: Many[Node]) -> None:
    """Give ``parent`` its children, in py_trees' list and in the tuple that the tick walks."""
    for child in children:
        child.parent = parent
    parent.children = list(children)
    parent.members = tuple(children)
