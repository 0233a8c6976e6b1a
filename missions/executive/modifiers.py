"""Modifiers of the mission language, as py_trees decorators."""

from collections.abc import Mapping, Sequence
from typing import ClassVar, Self

from py_trees.common import Status

from behaviours.node import Node, reset_all
from behaviours.run import log
from config.units import quantity_text
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Modifier, Parent
from missions.executive.state import unmeasured_reason
from missions.language.expressions import Expression, Value
from missions.language.nodes import CLEANUP_CLAIMS, FINALLY
from missions.language.plan import Step

# Modifiers with times.

MAX_RETICK_INTERVAL = 1.5
"""Maximum seconds between two ticks of a ``timeout`` that count as successive; ticks are at most 1 s apart."""


class ForModifier(Modifier):
    """Halts the node once it has run for the time of the modifier, and succeeds.

    If the node ends earlier, the modifier ends with the same status.
    """

    run_state: ClassVar[tuple[str, ...]] = ("setting", "since")

    def on_running(self) -> Status:
        return self.end(SUCCESS) if self._is_over() else self.tick_child()

    def on_time_passed(self) -> Status:
        if self.ending is None and not self.unstarted and self._is_over():
            self.suspension = None
            return self.end(SUCCESS)
        return super().on_time_passed()

    def _is_over(self) -> bool:
        over: bool = self.run.now() - self.since >= self.setting
        return over


class TimeoutModifier(ForModifier):
    """Fails, and halts the node, if it still runs after the time of the modifier; then it is not ticked again.

    ``gave_up`` is the time (s) of the last failure while the node was suspended, that is, while a sensor did not
    report. After this failure, a reactive composite may tick the modifier again at once. If the node is suspended
    again, the modifier then fails at once, and does not wait for the whole time a second time.
    """

    run_state: ClassVar[tuple[str, ...]] = ("_waits",)
    lasting_state = ("gave_up",)
    gave_up: float | None = None
    _waits = False  # it waits for a node that is suspended

    def begin(self) -> None:
        self._waits = False

    def on_running(self) -> Status:
        return self._fail() if self._is_over() else self.tick_child()

    def on_time_passed(self) -> Status:
        if self.ending is None and not self.unstarted and self._is_over():
            return self._fail()
        return super().on_time_passed()

    def conclude(self, status: Status) -> Status:
        self._waits = status is RUNNING and self.suspension is not None
        if self.gave_up is not None:
            gave_up, self.gave_up = self.gave_up, None
            if self._waits and self.run.now() - gave_up < MAX_RETICK_INTERVAL:
                return self._fail()
        return status

    def _fail(self) -> Status:
        waited = f"timed out after {quantity_text(self.setting, 'duration')}"
        why = _running_tip(self.child).feedback_message
        self.feedback_message = f"{why} ({waited})" if why else f"{self.child.name} {waited}"
        self.gave_up = self.run.now() if self._waits else None
        self.suspension = None
        return self.end(FAILURE)


class HoldModifier(Modifier):
    """Succeeds once the node has succeeded at every tick for the time of the modifier; runs until then.

    A tick in which the node is suspended does not count. It fails if a sensor does not report for too long.
    """

    run_state = ("setting", "_succeeding_since")
    _succeeding_since: float | None = None

    def begin(self) -> None:
        self._succeeding_since = None

    def on_time_passed(self) -> Status:
        self._succeeding_since = None
        return super().on_time_passed()

    def conclude(self, status: Status) -> Status:
        if status is not SUCCESS:
            self._succeeding_since = None
            return FAILURE if status is FAILURE and self.suspension is not None else RUNNING
        now = self.run.now()
        if self._succeeding_since is None:
            self._succeeding_since = now
        return SUCCESS if now - self._succeeding_since >= self.setting else RUNNING


class DelayModifier(Modifier):
    """Waits for the time of the modifier before the node starts."""

    run_state = ("setting", "since")

    def on_running(self) -> Status:
        if self.child.status is RUNNING or self.run.now() - self.since >= self.setting:
            return self.tick_child()
        return RUNNING


class CooldownModifier(Modifier):
    """Fails without starting the node for a time (the value of the modifier) after the node's last success."""

    run_state = ("setting",)
    lasting_state = ("_succeeded_at",)
    _succeeded_at: float | None = None

    def on_running(self) -> Status:
        now = self.run.now()
        if self._succeeded_at is not None:
            remaining = self._succeeded_at + self.setting - now
            if remaining > 0:
                self.feedback_message = (
                    f"cooling down for {quantity_text(max(0.1, round(remaining, 1)), 'duration')} more"
                )
                return FAILURE
        return self.tick_child()

    def conclude(self, status: Status) -> Status:
        if status is SUCCESS:
            self._succeeded_at = self.run.now()
        return status


def _running_tip(node: Node) -> Node:
    """Return the node below ``node`` whose reason explains best why ``node`` runs.

    This is a suspended node, or a running leaf with a reason; ``node`` itself if there is none.
    """
    if node.suspension is not None:
        return node
    for child in node.children:
        if isinstance(child, Node) and child.status is RUNNING:
            found = _running_tip(child)
            if found.feedback_message:
                return found
    return node


class ConditionModifier(Modifier):
    """Modifier whose ``value`` is a condition; it fails if the condition uses values computed by dead reckoning."""

    def on_start(self) -> str:
        why = unmeasured_reason(self.value, self.scope)
        return f"{self.kind}: {why}" if why else super().on_start()

    def is_true(self) -> bool:
        """Evaluate the condition. Raises ExpressionError."""
        return bool(self.value.resolve(self.scope))

    def false_reason(self) -> str:
        """Return the reason if the condition is false."""
        condition = self.value.template
        return (
            f"not true: {condition.text if isinstance(condition, Expression) else 'a condition that is always false'}"
        )


class IfModifier(ConditionModifier):
    """Runs the node if a condition is true at the start; otherwise the node is skipped."""

    run_state = ("setting",)

    def on_running(self) -> Status:
        return self.tick_child() if self.setting else self.skip(self.false_reason())


class WhileModifier(ConditionModifier):
    """Runs the node while a condition is true, checked at every tick; once it is false, halts the node and fails."""

    def on_running(self) -> Status:
        if self.is_true():
            return self.tick_child()
        self.feedback_message = self.false_reason()
        return self.end(FAILURE)


class UntilModifier(ConditionModifier):
    """Runs the node until a condition is true, checked at every tick; then the node is halted and succeeds."""

    def on_running(self) -> Status:
        return self.end(SUCCESS) if self.is_true() else self.tick_child()


class RetryModifier(Modifier):
    """Restarts the node at the next tick after a failure, without a backoff.

    The modifier's value is the number of attempts, None for no limit. A second member, the ``recovery``, starts at the
    tick after each failed attempt, except the last. The next attempt starts at the tick after the recovery has ended,
    with any result. A halt of the modifier also halts the recovery.
    """

    run_state = ("setting", "_attempts", "_recovers")
    _attempts = 0
    _recovers = False  # an attempt has failed, and the recovery has not ended yet

    @property
    def recovery(self) -> Node | None:
        """Node that runs between two attempts, if any."""
        return self.members[1] if len(self.members) > 1 else None

    def begin(self) -> None:
        self._attempts = 0
        self._recovers = False

    def on_running(self) -> Status:
        if self._recovers and (recovery := self.recovery) is not None:
            return self.member_ended(recovery, recovery.execute_tick())
        if self.child.status is not RUNNING:
            self._attempts += 1
            reset_all(self.members)
        return self.tick_child()

    def member_ended(self, member: Node, status: Status) -> Status:
        if member is not self.recovery:
            return super().member_ended(member, status)
        self.feedback_message, self.suspension = member.feedback_message, member.suspension
        self._recovers = status is RUNNING
        return RUNNING

    def conclude(self, status: Status) -> Status:
        if status is not FAILURE or self._attempts == self.setting:
            return status
        self.keep_failure(self.feedback_message)
        self._recovers = self.recovery is not None
        return RUNNING


class RepeatModifier(Modifier):
    """Restarts the node at the next tick after a success; the setting is the number of runs, None for no limit."""

    run_state = ("setting", "_runs")
    _runs = 0

    def begin(self) -> None:
        self._runs = 0

    def on_running(self) -> Status:
        if self.child.status is not RUNNING:
            self._runs += 1
            self.child.reset()
        return self.tick_child()

    def conclude(self, status: Status) -> Status:
        return RUNNING if status is SUCCESS and self._runs != self.setting else status


class WaitFor(Modifier):
    """Ticks the node until it succeeds: a failure means "not yet", except after the sensor timeout.

    It restarts the node at the next tick after a failure.
    """

    @classmethod
    def from_step(cls, step: Step, children: Sequence[Node], inner: dict[str, object]) -> Self:
        del inner
        return cls(step.name, children[0], Value())

    def on_running(self) -> Status:
        if self.child.status is not RUNNING:
            self.child.reset()
        return self.tick_child()

    def conclude(self, status: Status) -> Status:
        return RUNNING if status is FAILURE and self.suspension is None else status


class InvertModifier(Modifier):
    """Exchanges success and failure; a failure because a sensor does not report stays a failure."""

    def conclude(self, status: Status) -> Status:
        if status is SUCCESS:
            self.feedback_message = f"{self.child.name} succeeded"
            return FAILURE
        return SUCCESS if status is FAILURE and self.suspension is None else status


class OnFailureModifier(Modifier):
    """Turns a failure of the node into a success."""

    def conclude(self, status: Status) -> Status:
        return SUCCESS if status is FAILURE else status


class OnSuccessModifier(Modifier):
    """Turns a success of the node into a failure."""

    def conclude(self, status: Status) -> Status:
        if status is SUCCESS:
            self.feedback_message = f"{self.child.name} succeeded"
            return FAILURE
        return status


class OnRunningModifier(Modifier):
    """Ends the node in a success or failure (its value) as soon as the node runs, and halts it.

    While the node is suspended, it waits.
    """

    run_state = ("setting",)

    def conclude(self, status: Status) -> Status:
        if status is not RUNNING or self.suspension is not None:
            return status
        if self.setting == "succeed":
            return self.end(SUCCESS)
        why = self.feedback_message
        self.feedback_message = f"{self.child.name} still runs" + (f": {why}" if why else "")
        return self.end(FAILURE)


class OnceModifier(Modifier):
    """Runs the node once, then returns its first result while the value of the modifier's expression stays the same.

    A failure because a sensor does not report is not stored.
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


class FinallyModifier(Modifier):
    """Runs the node, then once its second member, the ``cleanup``; the modifier ends with the result of the node.

    - The cleanup also runs if the node is halted, and if it is skipped after it has run, as within a ``repeat``.
    - It is a part of the end or the halt of the node: no other node starts before the cleanup is over.
    - It is halted after the time limit in ``setting`` (s), or of a cleanup that contains it, but has at least one tick.
    - It cannot move anything. `mission check` refuses leaves in it that claim an actuator. A cleanup with such a leaf
      does not run, and the robot refuses its commands (see ``Node.in_finally``).
    - So it may also run while time passes without ticks.
    """

    run_state = ("setting", "_cleanup_since", "_has_run")
    _cleanup_since: float | None = None
    _has_run = False  # the node was not skipped in its first tick
    _cleanup_tick = -1

    @property
    def cleanup(self) -> Node:
        """Node that runs at the end."""
        return self.members[1]

    def begin(self) -> None:
        self._cleanup_since, self._has_run = None, False
        reset_all(self.members)

    def tick_child(self) -> Status:
        if self._has_run:
            return self.member_ended(self.child, self.child.execute_tick())
        return super().tick_child()

    def conclude(self, status: Status) -> Status:
        if status is not RUNNING:
            return self.end(status)
        self._has_run |= self.suspension is None
        return RUNNING

    def end(self, status: Status) -> Status:
        """Halt the node, then run the cleanup; return ``status`` once that is over, RUNNING until then."""
        self.ending, self._ending_for = status, self.suspension
        if not self.child.halt() or not self._clean_up():
            return RUNNING
        self.ending = self._ending_for = None
        return self.skip(self.child.feedback_message) if status is SUCCESS and self.child.is_skipped else status

    def _clean_up(self) -> bool:
        """Start the cleanup, or tick it; return whether it is over. It is ticked once in a tick of the run."""
        run, cleanup = self.run, self.cleanup
        now = run.now()
        if self._cleanup_since is None:
            if not cleanup.claims <= CLEANUP_CLAIMS:
                return True
            self._cleanup_since = now
            self.keep_failure(self.feedback_message if self.child.status is FAILURE else "")
        elif self.is_cleanup_over() or cleanup.status is not RUNNING:
            return cleanup.halt()
        elif self._cleanup_tick == run.tick:
            return False
        self._cleanup_tick = run.tick
        # A halt may come from a leaf that is about to start. It waits for this node, which must not wait for it.
        leaf, preemptible = run.active_leaf, run.preemptible
        run.preemptible = [node for node in preemptible if self not in node.iterate()]
        try:
            if cleanup.execute_tick() is not RUNNING:
                return True
        finally:
            run.active_leaf, run.preemptible = leaf, preemptible
        return self.is_cleanup_over() and cleanup.halt()

    def is_cleanup_over(self) -> bool:
        """Return True if the time limit of the cleanup, or of a cleanup that contains this node, is over."""
        since = self._cleanup_since
        if since is not None and self.run.now() - since >= self.setting:
            return True
        node: Node = self
        while isinstance(parent := node.parent, Parent):
            if isinstance(parent, FinallyModifier) and node is parent.cleanup:
                return parent.is_cleanup_over()
            node = parent
        return False

    def clear_results(self, cleared: list[Node]) -> None:
        """Clear all results, after a final halt that took too long; a cleanup that has not started has one tick."""
        if self.status is RUNNING:
            self.child.clear_results(cleared)
            if self._cleanup_since is None:
                self._clean_up()
            if self.cleanup.status is RUNNING:
                self.cleanup.halt()
                log.warning("the 'finally' of %s (line %s) was cut off", self.child.name, self.line)
        super().clear_results(cleared)


MODIFIERS: Mapping[str, type[Modifier]] = {
    "if": IfModifier,
    "while": WhileModifier,
    "until": UntilModifier,
    "for": ForModifier,
    "timeout": TimeoutModifier,
    "retry": RetryModifier,
    "repeat": RepeatModifier,
    "invert": InvertModifier,
    "on_failure": OnFailureModifier,
    "on_success": OnSuccessModifier,
    "on_running": OnRunningModifier,
    "hold": HoldModifier,
    "delay": DelayModifier,
    "cooldown": CooldownModifier,
    "once": OnceModifier,
    FINALLY: FinallyModifier,
}
