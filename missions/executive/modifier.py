"""The base of all modifiers: one node around another."""

from collections.abc import Sequence
from typing import Any, Self

from py_trees.common import Status
from py_trees.decorators import Decorator

from behaviours.node import Node
from missions.executive.parent import SUCCESS, Parent
from missions.language.expressions import ExpressionError
from missions.language.plan import Step
from missions.language.values import Value


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
    def of(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
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
    def skipped(self) -> bool:
        return self.status is SUCCESS and self.child.skipped

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
