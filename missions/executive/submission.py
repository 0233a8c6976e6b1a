"""Sub-missions: a scope with variables of its own, params from the caller, results returned to the caller."""

from collections.abc import Mapping, Sequence
from typing import Self

from py_trees.common import Status
from py_trees.decorators import Decorator

from behaviours.node import Node
from drivers.errors import NotConnected
from missions.executive.parent import FAILURE, IDLE, RUNNING, SUCCESS, Parent
from missions.language.expressions import ExpressionError, Value
from missions.language.plan import Step


class Submission(Parent, Decorator):
    """Runs the tree of another mission, named ``mission``.

    ``params`` are evaluated with the caller's variables at each start; ``inner`` holds the variables of the
    sub-mission, cleared at each start. ``returns`` are expressions, evaluated with ``inner`` at the end. Their values
    are stored as variables of the caller: under their own names, or together under ``keep_as``. Unless the tree has
    succeeded, those that raise an error are left out. If the tree is skipped, so is the sub-mission.
    """

    def __init__(
        self,
        name: str,
        child: Node,
        *,
        mission: str,
        params: Mapping[str, Value],
        returns: Mapping[str, Value],
        inner: dict[str, object],
        keep_as: str | None,
    ) -> None:
        Decorator.__init__(self, name, child)
        self.members = (child,)
        self.mission = mission
        self.params = params
        self.returns = returns
        self.inner = inner
        self.keep_as = keep_as
        self._initial_variables = dict(inner)

    @classmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        return cls(
            step.name,
            children[0],
            mission=step.text,
            params=step.arguments,
            returns=step.returns,
            inner=inner,
            keep_as=step.output_variable,
        )

    def on_start(self) -> str:
        (child,) = self.members
        child.reset()
        try:
            param_values = {name: value.resolve(self.scope) for name, value in self.params.items()}
        except (ExpressionError, ValueError) as error:
            return f"with: {error}"
        self.inner.clear()
        self.inner.update(self._initial_variables, **param_values)
        self.run.variables_changed = True
        return ""

    def on_running(self) -> Status:
        (child,) = self.members
        # After its end, a return value may not be reported yet.
        status = child.execute_tick() if child.status in (RUNNING, IDLE) else child.status
        return self.member_ended(child, status)

    def member_ended(self, member: Node, status: Status) -> Status:
        if status is RUNNING:
            self.suspension = member.suspension
            return RUNNING
        problem = self._store_results(waits=status is SUCCESS and not member.is_skipped)
        if status is FAILURE:
            return self.adopt_failure(member)
        if member.is_skipped:
            return self.skip(member.feedback_message)
        if problem:
            self.feedback_message = f"returns: {problem}"
            return FAILURE
        return SUCCESS

    def _store_results(self, *, waits: bool) -> str:
        """Store the results of the sub-mission; return the reason if one cannot be evaluated, empty otherwise.

        A result may need a part of the robot that does not report now. With ``waits``, NotConnected is raised for it,
        so that the caller can wait for the part.
        """
        results, problem = {}, ""
        for name, value in self.returns.items():
            try:
                results[name] = value.resolve(self.inner)
            except (ExpressionError, ValueError, NotConnected) as error:
                if waits and isinstance(error, NotConnected):
                    raise
                problem = problem or str(error)
        self.scope.update(results if self.keep_as is None else {self.keep_as: results})
        self.run.variables_changed = True
        return problem
