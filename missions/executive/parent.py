"""What every node with children does alike: start afresh, halt what runs below, and end once that is at rest."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Self

from py_trees.common import Status

from behaviours.node import Node
from drivers.errors import NotConnected
from missions.language.expressions import ExpressionError
from missions.language.plan import Step

RUNNING, SUCCESS, FAILURE, IDLE = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Parent(Node):
    """A node with ``members``, its children, as the tick walks them.

    ``ending`` is the result that will stand once every member that still runs has been halted; IDLE when it was this
    node that was told to halt. ``unstarted`` is whether its start waits for a part of the robot to report.
    """

    lasting_state: ClassVar[tuple[str, ...]] = ("ending", "unstarted")
    members: tuple[Node, ...] = ()
    ending: Status | None = None
    unstarted = False

    @classmethod
    @abstractmethod
    def of(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        """Make the node of a step around its children; ``inner`` are the variables of the mission that they are in."""

    def on_tick(self) -> Status:
        """Start if need be, then tick on.

        Ticked again before its halt is through, it finishes that first and starts afresh.
        """
        self.visited = self.run.tick
        afresh = self.unstarted or self.status is not RUNNING
        if self.ending is not None:
            status = self.end(self.ending)
            if status is not IDLE:
                return status
            afresh = True
        try:
            if afresh:
                self.feedback_message = ""
                self.unstarted = True
                problem = self.on_start()
                self.unstarted = False
                if problem:
                    self.feedback_message = problem
                    return FAILURE
            return self.on_running()
        except NotConnected as error:  # what an expression asks for is not reported just now
            self.feedback_message = f"waiting: {error}"
            return RUNNING
        except ExpressionError as error:
            self.feedback_message = f"{self.kind}: {error}"
            return self.end(FAILURE)

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
        return status if at_rest else RUNNING

    def blame(self, member: Node) -> Status:
        """Return a failure, for the reason that ``member`` gives."""
        self.feedback_message = member.feedback_message
        return FAILURE

    def halt(self) -> bool:
        """Halt every member that runs; True once all are at rest."""
        if self.status is not RUNNING:
            return True
        if self.end(IDLE) is RUNNING:
            return False
        self.publish(IDLE)
        return True

    def forget(self, forgotten: list[Node]) -> None:
        """Forget the result, and those of the members before it."""
        if self.status is not IDLE:
            for member in self.members:
                member.forget(forgotten)
            super().forget(forgotten)

    def give_up(self) -> None:
        """Forget an end that was under way."""
        self.ending = None
