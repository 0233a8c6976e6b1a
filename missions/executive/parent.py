"""Base classes of nodes with children: start, halt of the running children, and end once they are at rest."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Self

from py_trees.common import Status
from py_trees.decorators import Decorator

from behaviours.node import Node, Suspension, reset_all, sensor_timeout_reason
from drivers.errors import NotConnected
from missions.language.expressions import ExpressionError, Value
from missions.language.nodes import FAILURE_NAME
from missions.language.plan import Step

RUNNING, SUCCESS, FAILURE, IDLE = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Parent(Node):
    """A node with ``members``, its children in the order of ticking.

    ``ending`` is the result to publish once all running members are halted; IDLE if this node itself is halted.
    ``unstarted`` is true while the node waits for a part of the robot before it can start.

    A parent is suspended if its own expression reads a part that does not report, or if its status is that of a
    suspended member. In the first case it waits, and fails after the sensor timeout.

    ``failure`` is a scope with one name, FAILURE_NAME: the reason of the last failure of a member, which expressions of
    later members read. It is None if no expression reads it.
    """

    lasting_state: ClassVar[tuple[str, ...]] = ("ending", "unstarted", "_ending_for", "_silent_since")
    members: tuple[Node, ...] = ()
    ending: Status | None = None
    unstarted = False
    failure: dict[str, object] | None = None
    _ending_for: Suspension | None = None  # the suspension that ends it

    @classmethod
    @abstractmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        """Make the node of a ``step`` of the plan around its children.

        ``inner`` holds the variables of the sub-mission, if the step is one.
        """

    def on_tick(self) -> Status:
        """Start if needed, then tick the members; return the status.

        If an earlier halt is not complete, complete it first, then restart.
        """
        self.visited_tick = self.run.tick
        afresh = self.unstarted or self.status is not RUNNING
        if self.ending is not None:
            self.suspension = self._ending_for
            status = self.end(self.ending)
            if status is not IDLE:
                return status
            afresh = True
        before, self.suspension = self.suspension, None
        if before is not None:
            self.feedback_message = ""
        try:
            status = self._start_and_run() if afresh else self.on_running()
            self._silent_since = None
        except NotConnected as error:  # a value that the expression needs is not reported at the moment
            status = self._suspend(str(error))
        except ExpressionError as error:
            self.feedback_message = f"{self.kind}: {error}"
            status = self.end(FAILURE)
        if self.suspension is not before:
            self.show_suspension(status, before)
        return status

    def _start_and_run(self) -> Status:
        self.feedback_message = ""
        was_skipped, self.is_skipped = self.is_skipped, False
        self.unstarted = True
        problem = self.on_start()
        self.unstarted = False
        if problem:
            self.feedback_message = problem
            return FAILURE
        status = self.on_running()
        if self.is_skipped is not was_skipped and status is self.status:  # which nobody else publishes
            self.publish(status)
        return status

    def _suspend(self, reason: str) -> Status:
        """Wait because a sensor does not report (``reason``); return a failure once that lasts too long."""
        self.suspension = self.suspension_for(reason)
        if self.suspension.timed_out:
            self.feedback_message = sensor_timeout_reason(reason, self.run.sensor_timeout)
            return self.end(FAILURE)
        self.feedback_message = f"waiting: {reason}"
        if self.unstarted:
            return RUNNING
        return self.members_stand_still()

    def on_time_passed(self) -> Status:
        """Let time pass without a tick, while this node is suspended; return the status.

        A halt that has begun is continued, and deadlines of running members are checked.
        """
        if self.ending is not None:
            self.suspension = self._ending_for
            status = self.end(self.ending)
            if status is not IDLE:
                return status
            self.unstarted = True
        if self.unstarted:
            return RUNNING
        try:
            return self.members_stand_still()
        except NotConnected:  # raised by a member that has ended; it is checked again at the next tick
            return RUNNING

    def members_stand_still(self) -> Status:
        """Let time pass without a tick for the running members; return the status of this node."""
        for member in self.members:
            if member.status is RUNNING:
                status = member.pass_time()
                if status is not RUNNING and status is not IDLE:
                    return self.member_ended(member, status)
        return RUNNING

    def member_ended(self, member: Node, status: Status) -> Status:
        """Return the status of this node after ``member`` ended without a tick. Must not start anything."""
        self.feedback_message, self.suspension = member.feedback_message, member.suspension
        return status

    def on_start(self) -> str:
        """Prepare a new run of the node; return the reason if it cannot start, empty otherwise."""
        return ""

    @abstractmethod
    def on_running(self) -> Status:
        """Tick the members by the rule of this node."""

    def end(self, status: Status) -> Status:
        """Halt the running members; return ``status`` once they are at rest, RUNNING until then."""
        at_rest = True
        for member in self.members:
            if member.status is RUNNING:
                at_rest &= member.halt()
        self.ending = None if at_rest else status
        self._ending_for = None if at_rest else self.suspension
        return status if at_rest else RUNNING

    def keep_failure(self, reason: str) -> None:
        """Keep the reason of a failure for the expressions that read it; empty after any other end."""
        if self.failure is not None:
            self.failure[FAILURE_NAME] = reason

    def adopt_failure(self, member: Node) -> Status:
        """Return a failure with the reason of ``member``."""
        self.feedback_message = member.feedback_message
        self.suspension = member.suspension
        return FAILURE

    def skip(self, reason: str) -> Status:
        """Mark this node as skipped, with the reason, and return its status SUCCESS."""
        self.is_skipped = True
        self.feedback_message = reason
        return SUCCESS

    def halt(self) -> bool:
        """Halt all running members; return True once they are at rest."""
        if self.status is not RUNNING:
            return True
        if self.end(IDLE) is RUNNING:
            return False
        self.publish(IDLE)
        return True

    def clear_results(self, cleared: list[Node]) -> None:
        """Set this node and its members to idle, members first, and append them to ``cleared``."""
        if self.status is not IDLE:
            for member in self.members:
                member.clear_results(cleared)
            self.is_skipped = False
            super().clear_results(cleared)

    def abandon_halt(self) -> None:
        """Stop waiting for the members that are being halted."""
        self.ending = None


class Composite(Parent):
    """Base class of composites; they clear their children's results when they start."""

    @classmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        del inner
        composite = cls(step.name)
        set_children(composite, children)
        return composite

    def on_start(self) -> str:
        reset_all(self.members)
        self.begin()
        return ""

    def begin(self) -> None:
        """Reset the progress of an earlier run."""


def set_children(parent: Parent, children: Sequence[Node]) -> None:
    """Set the children of ``parent``: the list that py_trees uses, and the tuple that our nodes tick."""
    for child in children:
        child.parent = parent
    parent.children = list(children)
    parent.members = tuple(children)


# Base of all modifiers: one node around another.


class Modifier(Parent, Decorator):
    """A node around its first child.

    ``value`` is the modifier's value as in the mission, ``setting`` as evaluated when the node starts. If the child is
    skipped, the modifier is skipped as well.
    """

    child: Node
    setting: Any = None
    since = 0.0

    def __init__(self, name: str, child: Node, value: Value) -> None:
        Decorator.__init__(self, name, child)
        self.child = child
        self.members = (child,)
        self.value = value

    @classmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        del inner
        modifier = cls(step.name, children[0], step.arguments["value"])
        set_children(modifier, children)
        return modifier

    def on_start(self) -> str:
        self.since = self.run.now()
        try:
            self.setting = self.value.resolve(self.scope)
        except (ExpressionError, ValueError) as error:
            return f"{self.kind}: {error}"
        self.begin()
        return ""

    def begin(self) -> None:
        """Reset the progress of an earlier run."""

    def on_running(self) -> Status:
        return self.tick_child()

    def tick_child(self) -> Status:
        """Tick the child, and return the status of this node."""
        status = self.child.execute_tick()
        if status is SUCCESS and self.child.is_skipped:
            return self.skip(self.child.feedback_message)
        return self.member_ended(self.child, status)

    def member_ended(self, member: Node, status: Status) -> Status:
        return self.conclude(super().member_ended(member, status))

    def conclude(self, status: Status) -> Status:
        """Return the status of this node for the child's status; by default the same."""
        return status
