"""The modifiers of the mission language, as py_trees decorators."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

from py_trees.common import Status
from py_trees.decorators import Decorator

from behaviours.node import Node
from config.units import written
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Parent
from missions.executive.state import unmeasured
from missions.language.expressions import Expression, ExpressionError
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

    def begin(self) -> None:
        """Forget an earlier run of it."""

    def tick_child(self) -> Status:
        """Tick the child and pass its reason on."""
        status = self.child.execute_tick()
        self.feedback_message = self.child.feedback_message
        return status


class Condition(Modifier):
    """One whose ``value`` is a condition; it fails where that rests on what nothing measures."""

    def on_start(self) -> str:
        why = unmeasured(self.value, self.scope)
        return f"{self.kind}: {why}" if why else super().on_start()

    def true_now(self) -> bool:
        """Ask the expression in ``value`` now. Raises ExpressionError."""
        return bool(self.value.resolve(self.scope))


class If(Condition):
    """Asked once, at the start; where it is false the node is skipped and succeeds."""

    run_state = ("setting",)

    def on_running(self) -> Status:
        return self.tick_child() if self.setting else SUCCESS


class While(Condition):
    """Asked at every tick; once it is false the node is halted and fails."""

    def on_running(self) -> Status:
        if self.true_now():
            return self.tick_child()
        condition = self.value.template
        asked = condition.text if isinstance(condition, Expression) else "a condition that is always false"
        self.feedback_message = f"not true: {asked}"
        return self.end(FAILURE)


class Until(Condition):
    """Asked at every tick; once it is true the node is halted and succeeds."""

    def on_running(self) -> Status:
        return self.end(SUCCESS) if self.true_now() else self.tick_child()


class Timeout(Modifier):
    """Fails, halting the node, when it still runs after that long; at the deadline it is not ticked once more."""

    run_state = ("setting", "since")

    def on_running(self) -> Status:
        if self.run.now() - self.since >= self.setting:
            waited = f"timed out after {written(self.setting, 'duration')}"
            why = _tip(self.child).feedback_message
            self.feedback_message = f"{why} ({waited})" if why else f"{self.child.name} {waited}"
            return self.end(FAILURE)
        return self.tick_child()


class Retry(Modifier):
    """Starts again, at the next tick, after a failure; the setting counts attempts, None is for ever."""

    run_state = ("setting", "_attempts")
    _attempts = 0

    def begin(self) -> None:
        self._attempts = 0

    def on_running(self) -> Status:
        if self.child.status is not RUNNING:
            self._attempts += 1
            self.child.reset()
        status = self.tick_child()
        if status is not FAILURE or self._attempts == self.setting:
            return status
        return RUNNING


class Repeat(Modifier):
    """Starts again, at the next tick, after a success; the setting counts runs, None is for ever."""

    run_state = ("setting", "_runs")
    _runs = 0

    def begin(self) -> None:
        self._runs = 0

    def on_running(self) -> Status:
        if self.child.status is not RUNNING:
            self._runs += 1
            self.child.reset()
        status = self.tick_child()
        if status is not SUCCESS or self._runs == self.setting:
            return status
        return RUNNING


class Invert(Modifier):
    """Success for failure and failure for success."""

    def on_running(self) -> Status:
        status = self.tick_child()
        if status is SUCCESS:
            self.feedback_message = f"{self.child.name} succeeded"
            return FAILURE
        return SUCCESS if status is FAILURE else status


class OnFailure(Modifier):
    """A failure counts as success."""

    def on_running(self) -> Status:
        status = self.tick_child()
        return SUCCESS if status is FAILURE else status


class OnSuccess(Modifier):
    """A success counts as failure."""

    def on_running(self) -> Status:
        status = self.tick_child()
        if status is SUCCESS:
            self.feedback_message = f"{self.child.name} succeeded"
            return FAILURE
        return status


class OnRunning(Modifier):
    """A node that runs counts as a success or a failure, and is halted."""

    run_state = ("setting",)

    def on_running(self) -> Status:
        status = self.tick_child()
        if status is not RUNNING:
            return status
        if self.setting == "succeed":
            return self.end(SUCCESS)
        why = self.feedback_message
        self.feedback_message = f"{self.child.name} still runs" + (f": {why}" if why else "")
        return self.end(FAILURE)


class Hold(Modifier):
    """Succeeds once the node has succeeded at every tick for that long; until then it runs."""

    run_state = ("setting", "_succeeding_since")
    _succeeding_since: float | None = None

    def begin(self) -> None:
        self._succeeding_since = None

    def on_running(self) -> Status:
        if self.tick_child() is not SUCCESS:
            self._succeeding_since = None
            return RUNNING
        now = self.run.now()
        if self._succeeding_since is None:
            self._succeeding_since = now
        return SUCCESS if now - self._succeeding_since >= self.setting else RUNNING


class Delay(Modifier):
    """Waits before the node starts."""

    run_state = ("setting", "since")

    def on_running(self) -> Status:
        if self.child.status is RUNNING or self.run.now() - self.since >= self.setting:
            return self.tick_child()
        return RUNNING


class Cooldown(Modifier):
    """Fails without starting within that long after its last success."""

    run_state = ("setting",)
    lasting_state = ("_succeeded_at",)
    _succeeded_at: float | None = None

    def on_running(self) -> Status:
        now = self.run.now()
        if self._succeeded_at is not None:
            left = self._succeeded_at + self.setting - now
            if left > 0:
                self.feedback_message = f"cooling down for {written(max(0.1, round(left, 1)), 'duration')} more"
                return FAILURE
        status = self.tick_child()
        if status is SUCCESS:
            self._succeeded_at = now
        return status


class Once(Modifier):
    """After its first end, keeps answering with that result while the value that it had at the start stays the same."""

    run_state = ("setting",)
    lasting_state = ("_result",)
    _result: tuple[Status, str, object] | None = None

    def on_running(self) -> Status:
        if self._result is not None and self._result[2] == self.setting:
            status, self.feedback_message, _ = self._result
            return status
        if self._result is not None:
            self._result = None
            self.child.reset()
        status = self.tick_child()
        if status is not RUNNING:
            self._result = status, self.feedback_message, self.setting
        return status


def _tip(node: Node) -> Node:
    """Return the running leaf that best tells why ``node`` still runs: the first that has something to say."""
    for child in node.children:
        if isinstance(child, Node) and child.status is RUNNING:
            found = _tip(child)
            if found.feedback_message:
                return found
    return node


MODIFIERS: Mapping[str, type[Modifier]] = {
    "if": If,
    "while": While,
    "until": Until,
    "timeout": Timeout,
    "retry": Retry,
    "repeat": Repeat,
    "invert": Invert,
    "on_failure": OnFailure,
    "on_success": OnSuccess,
    "on_running": OnRunning,
    "hold": Hold,
    "delay": Delay,
    "cooldown": Cooldown,
    "once": Once,
}
