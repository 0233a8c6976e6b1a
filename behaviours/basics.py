"""Leaves that need no robot: waiting, logging, setting variables, and given outcomes for drafts and tests."""

from collections.abc import Sequence

from py_trees.common import Status

from behaviours.leaf import FAILURE, RUNNING, SUCCESS, Leaf, argument
from behaviours.run import log

# The leaf that tells somebody who is not there.


class Notify(Leaf):
    """Tell whoever gave the task: a line on the terminal, or a notice the way that the robot file says.

    Succeeds at once; the notice is delivered later, as often as that must be tried.
    """

    tag = "notify"
    ends = frozenset({"success"})
    instant = True
    text: str = argument("text", "what to tell", principal=True)

    def update(self) -> Status:
        self.run.notify(self.text)
        self.feedback_message = self.text
        return SUCCESS


class Wait(Leaf):
    """Wait for a while.

    Running until the time is over, then succeeds.
    """

    tag = "wait"
    ends = frozenset({"success"})
    duration: float = argument("duration", "how long", principal=True, low=0.0)

    def update(self) -> Status:
        return SUCCESS if self.elapsed >= self.duration else RUNNING


class Log(Leaf):
    """Write a line into the log.

    Succeeds at once.
    """

    tag = "log"
    instant = True
    text: str = argument("text", "what to write", principal=True)

    def update(self) -> Status:
        log.info("%s", self.text)
        self.feedback_message = self.text
        return SUCCESS


class Set(Leaf):
    """Set variables of the mission, such as `set: {count: 1}`.

    Succeeds at once.
    """

    tag = "set"
    instant = True
    open_ended = True

    def update(self) -> Status:
        self.scope.update(self.values)
        self.run.variables_changed = True
        return SUCCESS


class Succeed(Leaf):
    """Succeed at once."""

    tag = "succeed"

    def update(self) -> Status:
        return SUCCESS


class Fail(Leaf):
    """Fail at once, for a reason of your own."""

    tag = "fail"
    because: str = argument("text", "the reason to give", default="told to fail", principal=True)

    def update(self) -> Status:
        return self.fail(self.because)


class Pretend(Leaf):
    """Give these outcomes in turn, one a tick, from the first again once they are used up; for drafts and tests.

    A halt or a restart does not rewind it.
    """

    tag = "pretend"
    outcomes: Sequence[Status] = argument("outcomes", "running, success and failure, in turn", principal=True)
    _next = 0

    def update(self) -> Status:
        outcome = self.outcomes[self._next % len(self.outcomes)]
        self._next += 1
        if outcome is FAILURE:
            return self.fail("told to fail")
        return outcome
