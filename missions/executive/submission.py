"""A mission inside a mission: its own variables, its params from the caller's, its results handed back."""

from collections.abc import Mapping

from py_trees.common import Status
from py_trees.decorators import Decorator

from behaviours.node import Node
from missions.language.expressions import ExpressionError
from missions.language.values import Value

RUNNING, SUCCESS, FAILURE = Status.RUNNING, Status.SUCCESS, Status.FAILURE


class Submission(Node, Decorator):
    """Runs the tree of another mission.

    ``params`` are computed among the caller's variables each time that it starts; ``inner`` are the variables of the
    mission inside, forgotten at each start. ``returns`` are computed among these once it has succeeded, and kept under
    their own names, or together as ``keep_as``.
    """

    child: Node

    def __init__(
        self,
        name: str,
        child: Node,
        *,
        params: Mapping[str, Value],
        returns: Mapping[str, Value],
        inner: dict[str, object],
        keep_as: str | None,
    ) -> None:
        Decorator.__init__(self, name, child)
        self.child = child
        self.params = params
        self.returns = returns
        self.inner = inner
        self.keep_as = keep_as
        self._lasting = dict(inner)
        self._halting = False

    def work(self) -> Status:
        """Set the params at the start, then tick the mission inside."""
        if self._halting and not self._halt_child():
            return RUNNING
        if self.status is not RUNNING or self.child.status is not RUNNING:
            self.feedback_message = ""
            self.child.reset()
            try:
                given = {name: value.resolve(self.scope) for name, value in self.params.items()}
            except (ExpressionError, ValueError) as error:
                self.feedback_message = f"with: {error}"
                return FAILURE
            self.inner.clear()
            self.inner.update(self._lasting, **given)
        status = self.child.advance()
        self.feedback_message = self.child.feedback_message if status is FAILURE else ""
        return self._hand_back() if status is SUCCESS else status

    def _hand_back(self) -> Status:
        try:
            results = {name: value.resolve(self.inner) for name, value in self.returns.items()}
        except (ExpressionError, ValueError) as error:
            self.feedback_message = f"returns: {error}"
            return FAILURE
        self.scope.update(results if self.keep_as is None else {self.keep_as: results})
        return SUCCESS

    def halt(self) -> bool:
        """Halt the mission inside; True once it is at rest."""
        if self.status is not RUNNING:
            return True
        if not self._halt_child():
            return False
        self.publish(Status.INVALID)
        return True

    def _halt_child(self) -> bool:
        self._halting = not self.child.halt()
        return not self._halting
