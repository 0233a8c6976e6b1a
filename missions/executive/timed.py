"""The modifiers that go by the time."""

from py_trees.common import Status

from behaviours.node import Node
from config.units import written
from missions.executive.parent import FAILURE, RUNNING, SUCCESS, Modifier

ASKED_AGAIN = 1.5
"""Seconds within which a timeout is taken for asked again at the next tick: the slowest robot has a tick a second."""


class Timeout(Modifier):
    """Fails, halting the node, when it still runs after that long; at the deadline it is not ticked once more.

    After it has failed around a suspended node it fails at once while that is still suspended: ``gave_up`` is when it
    did so last. A reactive composite asks again at each tick, and would stand still for the whole time again.
    """

    run_state = ("setting", "since", "_waits")
    lasting_state = ("gave_up",)
    gave_up: float | None = None
    _waits = False  # for a node that is suspended

    def begin(self) -> None:
        self._waits = False

    def on_running(self) -> Status:
        return self._fail() if self._is_over() else self.tick_child()

    def on_standstill(self) -> Status:
        if self.ending is None and not self.unstarted and self._is_over():
            return self._fail()
        return super().on_standstill()

    def conclude(self, status: Status) -> Status:
        self._waits = status is RUNNING and self.suspension is not None
        if self.gave_up is not None:
            gave_up, self.gave_up = self.gave_up, None
            if self._waits and self.run.now() - gave_up < ASKED_AGAIN:
                return self._fail()
        return status

    def _is_over(self) -> bool:
        over: bool = self.run.now() - self.since >= self.setting
        return over

    def _fail(self) -> Status:
        waited = f"timed out after {written(self.setting, 'duration')}"
        why = _tip(self.child).feedback_message
        self.feedback_message = f"{why} ({waited})" if why else f"{self.child.name} {waited}"
        self.gave_up = self.run.now() if self._waits else None
        self.suspension = None
        return self.end(FAILURE)


class Hold(Modifier):
    """Succeeds once the node has succeeded at every tick for that long; until then it runs.

    A tick in which the node is suspended is none in which it succeeds. It fails where a sensor stays silent.
    """

    run_state = ("setting", "_succeeding_since")
    _succeeding_since: float | None = None

    def begin(self) -> None:
        self._succeeding_since = None

    def on_standstill(self) -> Status:
        self._succeeding_since = None
        return super().on_standstill()

    def conclude(self, status: Status) -> Status:
        if status is not SUCCESS:
            self._succeeding_since = None
            return FAILURE if status is FAILURE and self.suspension is not None else RUNNING
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
        return self.tick_child()

    def conclude(self, status: Status) -> Status:
        if status is SUCCESS:
            self._succeeded_at = self.run.now()
        return status


def _tip(node: Node) -> Node:
    """Return the node that best tells why ``node`` still runs: it where it is suspended, else a running leaf."""
    if node.suspension is not None:
        return node
    for child in node.children:
        if isinstance(child, Node) and child.status is RUNNING:
            found = _tip(child)
            if found.feedback_message:
                return found
    return node
