"""Composites of the mission language, as py_trees composites that halt the running child before another starts."""

from collections import abc
from collections.abc import Mapping
from random import Random
from typing import Any, ClassVar, Self

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.node import Node, Suspension, reset_all, sensor_timeout_reason
from missions.executive.parallel import Parallel, Race
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Composite
from missions.language.child_order import Weights
from missions.language.expressions import ExpressionError, Value
from missions.language.nodes import WEIGHTS
from missions.language.plan import Step

# Reactive composites: they tick their children from the first at every tick.


class _ReactiveComposite(Composite):
    """Ticks its children from the first at every tick; if an earlier child takes over, the running one is halted.

    While a child is suspended, the composite waits. ``_running`` is the child that ran before the wait; it keeps its
    progress, but is not ticked. ``_stood`` is true after such a wait, when more than one child may still run.
    ``_ended`` is a child whose deadline has passed during the wait; it is not started again when its turn comes.
    """

    run_state = ("_running", "_retiring", "_stood", "_ended")
    passes: ClassVar[Status]
    current_child: Behaviour | None
    _running: Node | None = None
    _retiring: tuple[Node, ...] = ()
    _stood = False
    _ended: Node | None = None

    def begin(self) -> None:
        self._running = self._ended = None
        self._retiring = ()
        self._stood = False
        self.keep_failure("")

    def on_running(self) -> Status:
        if not self._is_retired():
            return RUNNING
        running = self._running  # the running child, until the loop reaches it
        status = self.passes
        for child in self.members:
            self.current_child = child
            if child is running:
                running = None
            if child is self._ended:
                continue
            status = child.execute_tick() if running is None else self._tick_before(child, running)
            if child.suspension is not None:
                return self._suspend_with(child, running)
            if not self._leads_on(child, status):
                break
            if status is FAILURE:
                self.keep_failure(child.feedback_message)
        if self._stood:
            self._halt_others(child)
        self._running = child if status is RUNNING else None
        return RUNNING if status is RUNNING else self._end_with(child, status)

    def _end_with(self, child: Node, status: Status) -> Status:
        """End the composite, of which ``child`` was the last or the deciding one; return the composite's status.

        ``status`` is that of the child.
        """
        if status is SUCCESS and child.is_skipped:
            last = _last_unskipped(self.members, self.passes)
            if last is None:
                return self.end(self.skip(child.feedback_message))
            child, status = last, self.passes
        return self.end(self.adopt_failure(child) if status is FAILURE else status)

    def _leads_on(self, child: Node, status: Status) -> bool:
        """Return whether the composite continues with the next child after this status of ``child``."""
        return status is self.passes or (status is SUCCESS and child.is_skipped)

    def _suspend_with(self, child: Node, behind: Node | None) -> Status:
        """Wait for the suspended ``child``; return a failure once it has waited too long.

        ``behind`` is the running child after it, which gets no tick, but whose deadlines continue.
        """
        self.suspension = suspension = child.suspension
        if suspension is not None and suspension.timed_out:
            self.feedback_message = sensor_timeout_reason(suspension.reason, self.run.sensor_timeout)
            return self.end(FAILURE)
        self.feedback_message = child.feedback_message
        self._stood = True
        if behind is None or behind.status is not RUNNING:
            self._running = child
            return RUNNING
        status = behind.pass_time()
        if status is RUNNING:
            return RUNNING
        self._running = None
        if status is self.passes:
            self._ended = behind
            if status is FAILURE:
                self.keep_failure(behind.feedback_message)
            return RUNNING
        self.suspension, self.feedback_message = None, behind.feedback_message
        return self.end(status)

    def _halt_others(self, child: Node) -> None:
        """Halt all running children except ``child``, after the composite has waited for a suspended child."""
        self._stood, self._ended = False, None
        for other in self.members:
            is_halting = other in self._retiring
            if other is not child and not is_halting and other.status is RUNNING and not other.halt():
                self._retiring += (other,)

    def member_ended(self, member: Node, status: Status) -> Status:
        self._stood = True
        if member is self._running:
            self._running = None
        if status is not self.passes:
            return self.end(super().member_ended(member, status))
        self._ended = member
        if status is FAILURE:
            self.keep_failure(member.feedback_message)
        return RUNNING

    def _is_retired(self) -> bool:
        """Continue to halt preempted children; return True once all are at rest, or if no child is being halted."""
        if self._retiring:
            self._retiring = tuple([child for child in self._retiring if not child.halt()])
        return not self._retiring

    def _tick_before(self, child: Node, behind: Node) -> Status:
        """Tick ``child``, which has priority over the running child ``behind``; if it takes over, halt ``behind``.

        A leaf that is about to claim an actuator halts ``behind`` before it starts (through ``Run.preempt``). Other
        nodes take over by their status: ``behind`` is halted before that status is published.
        """
        preemptible = self.run.preemptible
        preemptible.append(behind)
        try:
            status = child.on_tick()
        finally:
            preemptible.pop()
        if child.suspension is None and not self._leads_on(child, status) and not behind.halt():
            self._retiring += (behind,)
        if status is not child.status:
            child.publish(status)
        return status


def _last_unskipped(members: abc.Sequence[Node], passes: Status) -> Node | None:
    """Return the last of ``members`` that ended with ``passes`` and was not skipped; None if all were skipped."""
    return next((member for member in reversed(members) if member.status is passes and not member.is_skipped), None)


class ReactiveSequence(_ReactiveComposite, composites.Sequence):
    """Sequence that restarts from the first child at every tick."""

    passes = SUCCESS

    def __init__(self, name: str) -> None:
        composites.Sequence.__init__(self, name, memory=False)


class ReactiveSelector(_ReactiveComposite, composites.Selector):
    """Selector that restarts from the first child at every tick."""

    passes = FAILURE

    def __init__(self, name: str) -> None:
        composites.Selector.__init__(self, name, memory=False)


class OrderedComposite(Composite):
    """Ticks one child after another, continuing with the running one.

    ``passes`` is the status of a child after which the next child runs; ``order`` is the order of the children.
    """

    run_state = ("_index", "order", "_lost", "_has_passed")
    passes: ClassVar[Status]
    order: tuple[Node, ...] = ()
    _index = 0
    _has_passed = False  # a child has ended without being skipped
    _lost: Suspension | None = None  # suspension of a child that has failed since its part was disconnected
    current_child: Behaviour | None

    def begin(self) -> None:
        self._index = 0
        self._has_passed = False
        self._lost = None
        self.order = self.members
        self.keep_failure("")

    def on_running(self) -> Status:
        order, passes, index = self.order, self.passes, self._index
        last = len(order) - 1
        while True:
            child = order[index]
            status = child.on_tick()
            if status is not child.status:  # `execute_tick` inlined, for speed
                child.publish(status)
            skipped = status is SUCCESS and child.is_skipped
            if (status is not passes and not skipped) or index == last:
                break
            self._has_passed = self._has_passed or not skipped
            if status is FAILURE:
                self.keep_failure(child.feedback_message)
            if child.suspension is not None:
                self._lost = child.suspension
            index += 1
        self._index = index
        self.current_child = child
        if status is RUNNING:
            self.suspension = child.suspension
        if skipped:
            return self._end_after_skip(child)
        return self._blame_last(child) if status is FAILURE else status

    def _end_after_skip(self, child: Node) -> Status:
        """Return the status of the composite if its last ``child`` was skipped.

        It is that of the last child that was not skipped; if all were, the composite is skipped as well.
        """
        if not self._has_passed:
            return self.skip(child.feedback_message)
        if self.passes is SUCCESS:
            return SUCCESS
        return self._blame_last(next(child for child in reversed(self.order) if child.status is FAILURE))

    def _blame_last(self, child: Node) -> Status:
        """Return a failure with the reason of ``child``, the last one.

        If any child failed because a sensor did not report, the composite also fails because of the sensor.
        """
        self.adopt_failure(child)
        if self.suspension is None and self.passes is FAILURE:
            self.suspension = self._lost
        return FAILURE

    def member_ended(self, member: Node, status: Status) -> Status:
        if status is not self.passes or self._index == len(self.order) - 1:
            return super().member_ended(member, status)
        self._lost = self._lost or member.suspension
        self._has_passed = True
        if status is FAILURE:
            self.keep_failure(member.feedback_message)
        self._index += 1  # the next child starts at the next tick
        return RUNNING


class Sequence(OrderedComposite, composites.Sequence):
    """Ticks its children one after another; fails at the first failure."""

    passes = SUCCESS

    def __init__(self, name: str) -> None:
        composites.Sequence.__init__(self, name, memory=True)


class Selector(OrderedComposite, composites.Selector):
    """Ticks its children one after another until one succeeds."""

    passes = FAILURE

    def __init__(self, name: str) -> None:
        composites.Selector.__init__(self, name, memory=True)


class InTurnSelector(Selector):
    """Selector that starts with the child after the one that ran last, until the end of the run."""

    lasting_state = ("_first",)
    _first = 0  # index of the child to start with

    def begin(self) -> None:
        super().begin()
        self.order = self.members[self._first :] + self.members[: self._first]

    def on_running(self) -> Status:
        status = super().on_running()
        ticked = self.order[: self._index + 1]
        last = next((child for child in reversed(ticked) if not child.is_skipped), None)
        if last is not None:
            self._first = (self.members.index(last) + 1) % len(self.members)
        return status


class RandomOrderComposite(OrderedComposite):
    """Ticks its children one after another, in an order that is drawn at each start with the seed of the run."""

    def begin(self) -> None:
        super().begin()
        order = list(self.members)
        self.run.random.shuffle(order)
        self.order = tuple(order)


class RandomSequence(RandomOrderComposite, composites.Sequence):
    """Sequence in a random order, drawn at each start."""

    passes: ClassVar[Status] = SUCCESS

    def __init__(self, name: str) -> None:
        composites.Sequence.__init__(self, name, memory=True)


class RandomSelector(RandomOrderComposite, composites.Selector):
    """Selector in a random order, drawn at each start."""

    passes: ClassVar[Status] = FAILURE
    weights: Value | None = None

    def __init__(self, name: str) -> None:
        composites.Selector.__init__(self, name, memory=True)

    @classmethod
    def from_step(cls, step: Step, children: abc.Sequence[Node], inner: dict[str, object]) -> Self:
        selector = super().from_step(step, children, inner)
        selector.weights = step.arguments.get(WEIGHTS)
        return selector

    def on_start(self) -> str:
        if self.weights is None:
            return super().on_start()
        try:
            weights: Any = self.weights.resolve(self.scope)
        except (ExpressionError, ValueError) as error:
            return f"{WEIGHTS}: {error}"
        reset_all(self.members)
        OrderedComposite.begin(self)
        self.order = _draw_order(self.run.random, self.members, weights)
        return ""


def _draw_order(random: Random, members: tuple[Node, ...], weights: Weights) -> tuple[Node, ...]:
    """Return the members in a random order, drawn one after another from those that are left, by their weights.

    If a member is skipped, the others so take over its chance in proportion to their weights. Members with the weight 0
    are left out.
    """
    rest = {member: weight for member, weight in zip(members, weights, strict=True) if weight}
    order = []
    while rest:
        (member,) = random.choices(list(rest), list(rest.values()))
        order.append(member)
        del rest[member]
    return tuple(order)


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
"""Classes of the composites with a list of children, by their word in the mission language."""
