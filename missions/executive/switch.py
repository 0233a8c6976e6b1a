"""The composite that chooses by the value of an expression."""

from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.node import Node
from missions.executive.composites import Composite
from missions.executive.parent import FAILURE
from missions.language.expressions import ExpressionError
from missions.language.values import Value, shown


class Switch(Composite, composites.Selector):
    """Does the child whose case is the value of an expression, asked once, at the start; else its default.

    ``cases`` belong to the members in order; one more member is the default.
    """

    current_child: Behaviour | None

    def __init__(self, name: str, on: Value, cases: tuple[object, ...]) -> None:
        composites.Selector.__init__(self, name, memory=True)
        self.on = on
        self.cases = cases
        self._chosen: Node | None = None

    def begin(self) -> None:
        self._chosen = None

    def go_on(self) -> Status:
        if self._chosen is None:
            try:
                found = self.on.resolve(self.scope)
            except (ExpressionError, ValueError) as error:
                self.feedback_message = f"switch: {error}"
                return FAILURE
            self._chosen = self._choose(found)
            if self._chosen is None:
                self.feedback_message = f"no case for {shown(found)}, and no default"
                return FAILURE
        self.current_child = self._chosen
        status = self._chosen.advance()
        return self.blame(self._chosen) if status is FAILURE else status

    def _choose(self, found: object) -> Node | None:
        for case, child in zip(self.cases, self.members, strict=False):
            # true is not 1, though Python says so; "3" in a case stands for the number and the text.
            same_kind = isinstance(case, bool) == isinstance(found, bool)
            if same_kind and (case == found or shown(case) == shown(found)):
                return child
        return self.members[-1] if len(self.members) > len(self.cases) else None
