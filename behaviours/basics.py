"""Leaves without a robot: wait, log, notify, set variables, and stubs for drafts and tests."""

from collections.abc import Sequence

from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Condition, Leaf, UnmeasuredError, argument
from behaviours.run import log

# The leaf that tells somebody who is not there.


class Notify(Leaf):
    """Notify the person who gave the task: a line on the terminal, or a notice as set in the robot file.

    Succeeds at once; the notice is delivered later, with retries.
    """

    tag = "notify"
    example = "- notify: The room is empty"
    acts = True
    ends = frozenset({"success"})
    instant = True
    text: str = argument("text", "text of the notice", principal=True)

    def update(self) -> Status:
        self.run.notify(self.text)
        self.feedback_message = self.text
        return SUCCESS


class Wait(Leaf):
    """Wait for a time.

    Running until the time is over, then succeeds.
    """

    tag = "wait"
    example = "- wait: 5 s"
    ends = frozenset({"success"})
    duration: float = argument("duration", "waiting time", principal=True, low=0.0)

    def update(self) -> Status:
        return SUCCESS if self.elapsed >= self.duration else RUNNING


class Check(Leaf):
    """Check a condition, once.

    Succeeds if it is true, and fails otherwise, with the values that it reads as the reason.
    """

    tag = "check"
    example = "- check: battery.percent > 20"
    instant = True
    condition: Condition = argument("condition", "an expression that is true or false", principal=True)

    def update(self) -> Status:
        try:
            return SUCCESS if self.condition.is_true() else self.fail(self.condition.false_reason())
        except ValueError as error:
            return self.fail(f"{self.label}: {error}")


class WaitUntil(Leaf):
    """Wait until a condition is true.

    Running until then, and then succeeds; a condition that cannot be calculated is not true. Add `timeout` for a limit.
    """

    tag = "wait_until"
    example = "- wait_until: base.button == 1"
    condition: Condition = argument("condition", "an expression that is true or false", principal=True)

    def update(self) -> Status:
        try:
            return SUCCESS if self.condition.is_true() else self.wait(self.condition.false_reason())
        except UnmeasuredError as error:
            return self.fail(f"{self.label}: {error}")
        except ValueError as error:
            return self.wait(str(error))


class Log(Leaf):
    """Write a line to the log.

    Succeeds at once.
    """

    tag = "log"
    example = "- log: The ball is red"
    acts = True
    instant = True
    text: str = argument("text", "text of the log line", principal=True)

    def update(self) -> Status:
        log.info("%s", self.text)
        self.feedback_message = self.text
        return SUCCESS


class Set(Leaf):
    """Set variables of the mission, such as `set: {count: 1}`.

    Succeeds at once.
    """

    tag = "set"
    example = "- set: {count: 1}"
    acts = True
    instant = True
    open_ended = True

    def update(self) -> Status:
        self.scope.update(self.values)
        self.run.variables_changed = True
        return SUCCESS


class Succeed(Leaf):
    """Succeed at once."""

    tag = "succeed"
    example = "- succeed"

    def update(self) -> Status:
        return SUCCESS


class Fail(Leaf):
    """Fail at once with a given reason."""

    tag = "fail"
    example = "- fail: no way out"
    because: str = argument("text", "reason of the failure", default="failed as requested", principal=True)

    def update(self) -> Status:
        return self.fail(self.because)


class Pretend(Leaf):
    """Stub: return the given outcomes in turn, one per tick; after the last, begin with the first again.

    After a halt or a restart, the next outcome follows; it does not begin with the first.
    """

    tag = "pretend"
    example = "- pretend: [running, running, success]"
    outcomes: Sequence[Status] = argument(
        "outcomes", "outcomes of the ticks: running, success, failure", principal=True
    )
    _next = 0

    def update(self) -> Status:
        outcome = self.outcomes[self._next % len(self.outcomes)]
        self._next += 1
        if outcome is FAILURE:
            return self.fail("failed as requested")
        return outcome
