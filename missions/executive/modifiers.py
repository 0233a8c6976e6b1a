"""The modifiers of the mission language, as py_trees decorators."""

from collections.abc import Mapping

from py_trees.common import Status

from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Modifier
from missions.executive.state import unmeasured
from missions.executive.timed import Cooldown, Delay, Hold, Timeout
from missions.language.expressions import Expression


class Condition(Modifier):
    """One whose ``value`` is a condition; it fails where that rests on what nothing measures."""

    def on_start(self) -> str:
        why = unmeasured(self.value, self.scope)
        return f"{self.kind}: {why}" if why else super().on_start()

    def true_now(self) -> bool:
        """Ask the expression in ``value`` now. Raises ExpressionError."""
        return bool(self.value.resolve(self.scope))

    def untrue(self) -> str:
        """Return the reason where it is false."""
        condition = self.value.template
        return (
            f"not true: {condition.text if isinstance(condition, Expression) else 'a condition that is always false'}"
        )


class If(Condition):
    """Asked once, at the start; where it is false the node is skipped and succeeds."""

    run_state = ("setting",)

    @property
    def skipped(self) -> bool:
        return super().skipped if self.setting else self.status is SUCCESS

    def on_running(self) -> Status:
        if self.setting:
            return self.tick_child()
        self.feedback_message = self.untrue()
        return SUCCESS


class While(Condition):
    """Asked at every tick; once it is false the node is halted and fails."""

    def on_running(self) -> Status:
        if self.true_now():
            return self.tick_child()
        self.feedback_message = self.untrue()
        return self.end(FAILURE)


class Until(Condition):
    """Asked at every tick; once it is true the node is halted and succeeds."""

    def on_running(self) -> Status:
        return self.end(SUCCESS) if self.true_now() else self.tick_child()


class Retry(Modifier):
    """Starts again, at the next tick, after a failure; the setting counts attempts, None is for ever."""

    run_state = ("setting", "_attempts")
    _attempts = 0

    @property
    def skipped(self) -> bool:
        return self._attempts == 1 and super().skipped

    def begin(self) -> None:
        self._attempts = 0

    def on_running(self) -> Status:
        if self.child.status is not RUNNING:
            self._attempts += 1
            self.child.reset()
        return self.tick_child()

    def conclude(self, status: Status) -> Status:
        return RUNNING if status is FAILURE and self._attempts != self.setting else status


class Repeat(Modifier):
    """Starts again, at the next tick, after a success; the setting counts runs, None is for ever."""

    run_state = ("setting", "_runs")
    _runs = 0

    @property
    def skipped(self) -> bool:
        return self._runs == 1 and super().skipped

    def begin(self) -> None:
        self._runs = 0

    def on_running(self) -> Status:
        if self.child.status is not RUNNING:
            self._runs += 1
            self.child.reset()
        return self.tick_child()

    def conclude(self, status: Status) -> Status:
        return RUNNING if status is SUCCESS and self._runs != self.setting else status


class Invert(Modifier):
    """Success for failure and failure for success; what failed because a sensor is silent has still failed."""

    def conclude(self, status: Status) -> Status:
        if status is SUCCESS:
            self.feedback_message = f"{self.child.name} succeeded"
            return FAILURE
        return SUCCESS if status is FAILURE and self.suspension is None else status


class OnFailure(Modifier):
    """A failure counts as success."""

    def conclude(self, status: Status) -> Status:
        return SUCCESS if status is FAILURE else status


class OnSuccess(Modifier):
    """A success counts as failure."""

    def conclude(self, status: Status) -> Status:
        if status is SUCCESS:
            self.feedback_message = f"{self.child.name} succeeded"
            return FAILURE
        return status


class OnRunning(Modifier):
    """A node that runs counts as a success or a failure, and is halted; one that is suspended is waited for."""

    run_state = ("setting",)

    def conclude(self, status: Status) -> Status:
        if status is not RUNNING or self.suspension is not None:
            return status
        if self.setting == "succeed":
            return self.end(SUCCESS)
        why = self.feedback_message
        self.feedback_message = f"{self.child.name} still runs" + (f": {why}" if why else "")
        return self.end(FAILURE)


class Once(Modifier):
    """After its first end, keeps answering with that result while the value that it had at the start stays the same.

    A failure because a sensor is silent is no answer, and not kept.
    """

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
        return self.tick_child()

    def conclude(self, status: Status) -> Status:
        if status is not RUNNING and self.suspension is None:
            self._result = status, self.feedback_message, self.setting
        return status


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
