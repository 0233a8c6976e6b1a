"""The composites that choose by the value of an expression, once or at every tick."""

from collections.abc import Mapping, Sequence
from typing import Self

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.node import Node
from missions.executive.parent import FAILURE, RUNNING, Composite, adopt
from missions.language.expressions import ExpressionError
from missions.language.nodes import REACTIVE_SWITCH, SWITCH
from missions.language.plan import Step
from missions.language.switches import case_key
from missions.language.values import Value, shown


class Switch(Composite, composites.Selector):
    """Does the child whose case is the value of an expression, asked once, at the start; else its default.

    ``cases`` belong to the members in order; one more member is the default.
    """

    run_state = ("_chosen",)
    current_child: Behaviour | None

    def __init__(self, name: str, on: Value, cases: tuple[object, ...]) -> None:
        composites.Selector.__init__(self, name, memory=True)
        self.on = on
        self.cases = cases
        self._chosen: Node | None = None

    @classmethod
    def of(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        del inner
        switch = cls(step.name, step.arguments["on"], step.cases)
        adopt(switch, children)
        return switch

    def begin(self) -> None:
        self._chosen = None

    def on_running(self) -> Status:
        if self._chosen is None:
            self._chosen = self.ask()
        return FAILURE if self._chosen is None else self.tick_chosen(self._chosen)

    def tick_chosen(self, child: Node) -> Status:
        """Tick the child that was chosen."""
        self.current_child = child
        status = child.execute_tick()
        self.suspension = child.suspension
        return self.blame(child) if status is FAILURE else status

    def ask(self) -> Node | None:
        """Return the child for the value that the expression has now; None, with a reason, where there is none."""
        try:
            found = self.on.resolve(self.scope)
        except (ExpressionError, ValueError) as error:
            self.feedback_message = f"{self.kind}: {error}"
            return None
        child = self._choose(found)
        if child is None:
            self.feedback_message = f"no case for {_written(found)}, and no default"
        return child

    def _choose(self, found: object) -> Node | None:
        key = case_key(found)
        fitting = (child for case, child in zip(self.cases, self.members, strict=False) if case_key(case) == key)
        return next(fitting, self.members[-1] if len(self.members) > len(self.cases) else None)


class ReactiveSwitch(Switch):
    """A switch that asks at every tick. Another case halts the child that runs, and starts once that is at rest."""

    def on_running(self) -> Status:
        chosen = self.ask()
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
"""The composites that choose, by their words."""


def _written(value: object) -> str:
    """Write a value as a case would be."""
    return str(value).lower() if isinstance(value, bool) else shown(value)
