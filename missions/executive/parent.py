"""What every node with children does alike: start afresh, halt what runs below, and end once that is at rest."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Self

from py_trees.common import Status
from py_trees.decorators import Decorator

from behaviours.node import Node, Suspension, reset_all, sensor_timeout_reason
from drivers.errors import NotConnected
from missions.language.expressions import ExpressionError, Value
from missions.language.plan import Step

RUNNING, SUCCESS, FAILURE, IDLE = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Parent(Node):
    """A node with ``members``, its children, as the tick walks them.

    ``ending`` is the result that will stand once every member that still runs has been halted; IDLE when it was this
    node that was told to halt. ``unstarted`` is whether its start waits for a part of the robot to report.

    It is suspended where an expression of its own asks for what is not reported just now, and where its answer is that
    of a suspended member. In the first case it stands still, and fails after the sensor timeout.
    """

    lasting_state: ClassVar[tuple[str, ...]] = ("ending", "unstarted", "_ending_for", "_silent_since")
    members: tuple[Node, ...] = ()
    ending: Status | None = None
    unstarted = False
    _ending_for: Suspension | None = None  # the suspension by which it ends

    @classmethod
    @abstractmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        """Make the node of a step around its children; ``inner`` are the variables of the mission that they are in."""

    def on_tick(self) -> Status:
        """Start if need be, then tick on.

        Ticked again before its halt is through, it finishes that first and starts afresh.
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
        except NotConnected as error:  # what an expression asks for is not reported just now
            status = self._suspend(str(error))
        except ExpressionError as error:
            self.feedback_message = f"{self.kind}: {error}"
            status = self.end(FAILURE)
        if self.suspension is not before:
            self.show_suspension(status, before)
        return status

    def _start_and_run(self) -> Status:
        self.feedback_message = ""
        self.unstarted = True
        problem = self.on_start()
        self.unstarted = False
        if problem:
            self.feedback_message = problem
            return FAILURE
        return self.on_running()

    def _suspend(self, reason: str) -> Status:
        """Stand still for a sensor that has not reported; fail once that lasts too long."""
        self.suspension = self.suspension_for(reason)
        if self.suspension.timed_out:
            self.feedback_message = sensor_timeout_reason(reason, self.run.sensor_timeout)
            return self.end(FAILURE)
        self.feedback_message = f"waiting: {reason}"
        if self.unstarted:
            return RUNNING
        return self.members_stand_still()

    def on_time_passed(self) -> Status:
        """Bring to an end what was ending, else let time pass for the members that run."""
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
        except NotConnected:  # asked by a member that has ended, and again at the next tick
            return RUNNING

    def members_stand_still(self) -> Status:
        """Let time pass for the members that run, and return the status that this node has then."""
        for member in self.members:
            if member.status is RUNNING:
                status = member.pass_time()
                if status is not RUNNING and status is not IDLE:
                    return self.member_ended(member, status)
        return RUNNING

    def member_ended(self, member: Node, status: Status) -> Status:
        """Return the status of this node after a member has ended while it stood still. Nothing may be started."""
        self.feedback_message, self.suspension = member.feedback_message, member.suspension
        return status

    def on_start(self) -> str:
        """Forget an earlier run; return why it cannot start, or nothing."""
        return ""

    @abstractmethod
    def on_running(self) -> Status:
        """Tick the members by this node's rule."""

    def end(self, status: Status) -> Status:
        """End with ``status`` once the members that still run are at rest; running until then."""
        at_rest = True
        for member in self.members:
            if member.status is RUNNING:
                at_rest &= member.halt()
        self.ending = None if at_rest else status
        self._ending_for = None if at_rest else self.suspension
        return status if at_rest else RUNNING

    def adopt_failure(self, member: Node) -> Status:
        """Return a failure, for the reason that ``member`` gives."""
        self.feedback_message = member.feedback_message
        self.suspension = member.suspension
        return FAILURE

    def halt(self) -> bool:
        """Halt every member that runs; True once all are at rest."""
        if self.status is not RUNNING:
            return True
        if self.end(IDLE) is RUNNING:
            return False
        self.publish(IDLE)
        return True

    def clear_results(self, cleared: list[Node]) -> None:
        """Forget the result, and those of the members before it."""
        if self.status is not IDLE:
            for member in self.members:
                member.clear_results(cleared)
            super().clear_results(cleared)

    def abandon_halt(self) -> None:
        """Forget an end that was under way."""
        self.ending = None


class Composite(Parent):
    """What all composites share: they forget their children's results when they start."""

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
        """Forget where an earlier run of it was."""


def set_children(parent: Composite, children: Sequence[Node]) -> None:
    """Give ``parent`` its children, in py_trees' list and in the tuple that the tick walks."""
    for child in children:
        child.parent = parent
    parent.children = list(children)
    parent.members = tuple(children)


# The base of all modifiers: one node around another.


class Modifier(Parent, Decorator):
    """One node around another: ``value`` as it stands in the mission, ``setting`` as it was when the node started."""

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
        return cls(step.name, children[0], step.arguments["value"])

    def on_start(self) -> str:
        self.since = self.run.now()
        try:
            self.setting = self.value.resolve(self.scope)
        except (ExpressionError, ValueError) as error:
            return f"{self.kind}: {error}"
        self.begin()
        return ""

    @property
    def is_skipped(self) -> bool:
        return self.status is SUCCESS and self.child.is_skipped

    def begin(self) -> None:
        """Forget an earlier run of it."""

    def on_running(self) -> Status:
        return self.tick_child()

    def tick_child(self) -> Status:
        """Tick the child, and return what this node makes of its status."""
        return self.member_ended(self.child, self.child.execute_tick())

    def member_ended(self, member: Node, status: Status) -> Status:
        return self.conclude(super().member_ended(member, status))

    def conclude(self, status: Status) -> Status:
        """Return the status of this node, which has the child's reason and suspension, from the child's status."""
        return status
