"""Nodes that select or repeat children by the value of an expression: switches and ``for_each``."""

from collections.abc import Mapping, Sequence
from typing import Self

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from behaviours.node import Node
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Composite, Parent, set_children
from missions.language.expressions import ExpressionError, Value, format_value
from missions.language.for_each import ListMembers
from missions.language.nodes import REACTIVE_SWITCH, SWITCH
from missions.language.plan import Step
from missions.language.switches import case_key

# Composites that choose by the value of an expression, once or at every tick.


class Switch(Composite, composites.Selector):
    """Ticks the child whose case equals the value of an expression, evaluated at the start; otherwise the default.

    ``on`` is the expression. ``cases`` belong to the children in order; one more child is the default.
    """

    run_state = ("_chosen",)
    current_child: Behaviour | None

    def __init__(self, name: str, on: Value, cases: tuple[object, ...]) -> None:
        composites.Selector.__init__(self, name, memory=True)
        self.on = on
        self.cases = cases
        self._chosen: Node | None = None

    @classmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        del inner
        switch = cls(step.name, step.arguments["on"], step.cases)
        set_children(switch, children)
        return switch

    def begin(self) -> None:
        self._chosen = None

    def on_running(self) -> Status:
        if self._chosen is None:
            self._chosen = self.select_child()
        return FAILURE if self._chosen is None else self.tick_chosen(self._chosen)

    def tick_chosen(self, child: Node) -> Status:
        """Tick the selected child."""
        self.current_child = child
        status = child.execute_tick()
        self.suspension = child.suspension
        if status is SUCCESS and child.is_skipped:
            return self.skip(child.feedback_message)
        return self.adopt_failure(child) if status is FAILURE else status

    def select_child(self) -> Node | None:
        """Return the child for the present value of the expression; None, with a reason, if no case has that value."""
        try:
            found = self.on.resolve(self.scope)
        except (ExpressionError, ValueError) as error:
            self.feedback_message = f"{self.kind}: {error}"
            return None
        child = self._choose(found)
        if child is None:
            self.feedback_message = f"no case for {_format_case(found)}, and no default"
        return child

    def _choose(self, found: object) -> Node | None:
        key = case_key(found)
        fitting = (child for case, child in zip(self.cases, self.members, strict=False) if case_key(case) == key)
        return next(fitting, self.members[-1] if len(self.members) > len(self.cases) else None)


class ReactiveSwitch(Switch):
    """Switch that evaluates at every tick; a new case halts the running child, and starts once that is at rest."""

    def on_running(self) -> Status:
        chosen = self.select_child()
        if chosen is None:
            return self.end(FAILURE)
        if self._chosen is not None and chosen is not self._chosen and not self._chosen.halt():
            return RUNNING
        self._chosen = chosen
        return self.tick_chosen(chosen)


SWITCHES: Mapping[str, type[Switch]] = {
    SWITCH: Switch,
    REACTIVE_SWITCH: ReactiveSwitch,
}
"""Classes of the two kinds of switches, by their word in the mission language."""


def _format_case(value: object) -> str:
    """Return a value as text in the notation of a case in a mission, such as ``true``."""
    return str(value).lower() if isinstance(value, bool) else format_value(value)


MAX_SHOWN_LENGTH = 40
"""Maximum number of characters of a list member that the reason of a failed ``for_each`` shows."""


class ForEach(Parent, Decorator):
    """Runs its child once for each member of a list, one after another. The list is evaluated at the start.

    ``among`` is the list. ``names`` are the variables for the member and, optionally, for its number. The node fails if
    the child fails, with the member in the reason, and succeeds at once if the list is empty. If the child is skipped
    for every member, the node is skipped as well.
    """

    run_state = ("setting", "_place", "_has_run")
    child: Node
    setting = ListMembers(())
    _place = 0
    _has_run = False  # for an earlier member, the child was not skipped

    def __init__(self, name: str, child: Node, among: Value, names: tuple[str, ...]) -> None:
        Decorator.__init__(self, name, child)
        self.child = child
        self.members = (child,)
        self.among = among
        self.names = names

    @classmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        del inner
        return cls(step.name, children[0], step.arguments["in"], step.binds)

    def on_start(self) -> str:
        try:
            found = self.among.resolve(self.scope)
        except (ExpressionError, ValueError) as error:
            return f"{self.kind}: {error}"
        self.setting = found if isinstance(found, ListMembers) else ListMembers(())
        self._place = 0
        self._has_run = False
        self.child.reset()
        return ""

    def on_running(self) -> Status:
        if self.child.status is not RUNNING:
            if self._place == 0 and self.setting.count == 0:
                return SUCCESS
            self._start_member()
        return self._on_child_status(self.child.execute_tick())

    def member_ended(self, member: Node, status: Status) -> Status:
        del member
        return self._on_child_status(status)

    def _on_child_status(self, status: Status) -> Status:
        """Return the status of this node for a status of the child: after a success, the next member follows."""
        self.suspension = self.child.suspension
        if status is FAILURE:
            self.feedback_message = f"{self.kind} {self._describe_member()}: {self.child.feedback_message}"
        if status is not SUCCESS:
            return status
        self._place += 1
        self._has_run = self._has_run or not self.child.is_skipped
        if self._place != self.setting.count:
            return RUNNING
        if not self._has_run:
            return self.skip(self.child.feedback_message)
        self.feedback_message = ""
        return SUCCESS

    def _start_member(self) -> None:
        """Set the variables of the loop to the next member of the list, and reset the child."""
        self.child.reset()
        values = (self.setting.member(self._place), self.setting.number(self._place))
        self.scope.update(zip(self.names, values, strict=False))
        self.run.variables_changed = True
        self.feedback_message = f"{self._place + 1} of {self.setting.count}: {self._describe_member()}"

    def _describe_member(self) -> str:
        """Return the present member of the list as text; its number if the member is the result of a leaf."""
        member = self.setting.member(self._place)
        text = " ".join(format_value(member).split()) if isinstance(member, str | int | float | Mapping | None) else ""
        if not text:
            return f"member {self._place + 1}"
        return text if len(text) <= MAX_SHOWN_LENGTH else f"{text[: MAX_SHOWN_LENGTH - 1]}…"
