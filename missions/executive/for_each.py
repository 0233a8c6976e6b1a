"""The node that does its child once for each member of a list."""

from collections.abc import Sequence
from typing import Self

from py_trees.common import Status
from py_trees.decorators import Decorator

from behaviours.node import Node
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Parent
from missions.language.expressions import ExpressionError
from missions.language.for_each import Members
from missions.language.plan import Step
from missions.language.values import Value, shown

MAX_SHOWN_LENGTH = 40
"""Characters of a member that a reason tells."""


class ForEach(Parent, Decorator):
    """Does its child once for each member of a list, which is asked for when it starts; the next at the next tick.

    ``names`` are the variables for the member and, if there is a second, for its number. It fails at the first
    failure, for the reason of its child with the member before it, and succeeds at once where there is no member.
    """

    run_state = ("setting", "_place")
    child: Node
    setting = Members(())
    _place = 0

    def __init__(self, name: str, child: Node, among: Value, names: tuple[str, ...]) -> None:
        Decorator.__init__(self, name, child)
        self.child = child
        self.members = (child,)
        self.among = among
        self.names = names

    @classmethod
    def of(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        del inner
        return cls(step.name, children[0], step.arguments["in"], step.binds)

    def on_start(self) -> str:
        try:
            found = self.among.resolve(self.scope)
        except (ExpressionError, ValueError) as error:
            return f"{self.kind}: {error}"
        self.setting = found if isinstance(found, Members) else Members(())
        self._place = 0
        self.child.reset()
        return ""

    def on_running(self) -> Status:
        if self.child.status is not RUNNING:
            if self._place == 0 and self.setting.count == 0:
                return SUCCESS
            self._take()
        return self._after(self.child.execute_tick())

    def member_ended(self, member: Node, status: Status) -> Status:
        del member
        return self._after(status)

    def _after(self, status: Status) -> Status:
        """Return the status of this node after one of the child."""
        self.suspension = self.child.suspension
        if status is FAILURE:
            self.feedback_message = f"{self.kind} {self._said()}: {self.child.feedback_message}"
        if status is not SUCCESS:
            return status
        self._place += 1
        if self._place != self.setting.count:
            return RUNNING
        self.feedback_message = ""
        return SUCCESS

    def _take(self) -> None:
        """Give the next member to the child."""
        self.child.reset()
        values = (self.setting.member(self._place), self.setting.number(self._place))
        self.scope.update(zip(self.names, values, strict=False))
        self.run.stored = True
        self.feedback_message = f"{self._place + 1} of {self.setting.count}: {self._said()}"

    def _said(self) -> str:
        """Return the member in words, its number where it is no plain value."""
        member = self.setting.member(self._place)
        said = " ".join(shown(member).split()) if isinstance(member, str | int | float | None) else ""
        if not said:
            return f"member {self._place + 1}"
        return said if len(said) <= MAX_SHOWN_LENGTH else f"{said[: MAX_SHOWN_LENGTH - 1]}…"
