"""Base class of all our behaviours and composites: a py_trees behaviour that is ticked without generators.

py_trees drives its nodes through ``tick()``, a generator, and stops them through ``stop()``, which it also sends to
nodes that have ended. Our nodes have three plain methods instead: ``execute_tick``, ``halt`` (stop a running node once,
over several ticks if necessary) and ``reset`` (clear an old result). ``tick()`` and ``stop()`` still work, so py_trees'
own tools do too.
"""

from abc import abstractmethod
from collections.abc import Iterable, Iterator
from typing import ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.run import RunState
from drivers.api.fast_dataclass import dataclass

# Suspension: a node cannot answer in a tick, only because a sensor has not reported.
#
# py_trees has no status for that: a suspended node is RUNNING and has a ``Suspension``. What its parent makes of it
# depends on the parent: a reactive composite stands still, most others are suspended as well.

NO_REPORT_SUFFIX = " does not report"


@dataclass(frozen=True, slots=True)
class Suspension:
    """Suspension of a node because a sensor has not reported; ``reason`` is such as "the range finder does not report".

    ``timed_out`` is true in the tick in which the suspension has lasted for the run's sensor timeout. The node then
    fails. A node around it may handle this failure, as ``retry`` does, but a reactive composite above it fails too.
    """

    reason: str
    timed_out: bool = False


def sensor_timeout_reason(reason: str, seconds: float) -> str:
    """Return the reason of a failure after a suspension for ``reason`` that has lasted ``seconds``."""
    limit = f"{seconds:g} s"
    if reason.endswith(NO_REPORT_SUFFIX):
        return f"{reason.removesuffix(NO_REPORT_SUFFIX)} has not reported for {limit}"
    return f"{reason} (waited for {limit})"


RUNNING, IDLE = Status.RUNNING, Status.INVALID  # looked up once: that takes ten times as long as to compare them


class Node(Behaviour):
    """Base class of all nodes: a py_trees behaviour with a place in a mission.

    ``key`` is its id within the tree ("1.2"), ``kind`` its tag in the mission language, ``line`` its line in ``file``.
    ``scope`` holds the variables of its mission. ``feedback_message`` (of py_trees) is the reason of a failure or a
    wait. ``visited_tick`` is the number of the last tick of the node. ``suspension`` is set if a silent sensor
    prevented a result in that tick. ``is_skipped`` is true for a node with the status SUCCESS whose behaviour did not
    start because of an ``if``: its parent continues as if the node were not in the list. ``in_finally`` is true within
    the ``finally`` of another node: the robot refuses each command of the node that could move something.

    Each class lists the attributes that decide its next status: ``run_state`` while it runs, ``lasting_state`` at any
    time. ``mission verify`` treats nodes with equal values as the same state.
    """

    run_state: ClassVar[tuple[str, ...]] = ()
    lasting_state: ClassVar[tuple[str, ...]] = ()
    key = ""
    kind = ""
    line = 0
    visited_tick = -1
    file = ""
    suspension: Suspension | None = None
    is_skipped = False
    in_finally = False
    _silent_since: float | None = None
    run: RunState
    scope: dict[str, object]

    @property
    def reason(self) -> str:
        """Reason of a failure, or the event that the node waits for."""
        return self.feedback_message

    @property
    def is_suspended(self) -> bool:
        """True while the node runs only because a sensor has not reported."""
        return self.status is RUNNING and self.suspension is not None

    @property
    def claims(self) -> frozenset[str]:
        """Actuators that the node, or any node below it, may drive."""
        return frozenset().union(*(child.claims for child in self.children if isinstance(child, Node)))

    def execute_tick(self) -> Status:
        """Tick once and return the new status."""
        status = self.on_tick()
        if status is not self.status:
            self.publish(status)
        return status

    @abstractmethod
    def on_tick(self) -> Status:
        """Do the work of one tick and return the new status without publishing it."""

    def update(self) -> Status:
        """Do the work of one tick when py_trees ticks the node; our own ticks call ``on_tick``."""
        return self.on_tick()

    def pass_time(self) -> Status:
        """Process time in which the node was not ticked, and return the new status; only for a running node."""
        before = self.suspension
        status = self.on_time_passed()
        if status is not self.status or (self.suspension is None) is not (before is None):
            self.publish(status)
        return status

    def on_time_passed(self) -> Status:
        """Return the new status after a time in which the node was not ticked.

        Deadlines that have passed have their effect, but no child starts and no leaf is ticked.
        """
        return self.status

    def suspension_for(self, reason: str) -> Suspension:
        """Return the suspension for this tick; it has timed out after the run's sensor timeout."""
        now = self.run.now()
        if self._silent_since is None:
            self._silent_since = now
        return Suspension(reason, timed_out=now - self._silent_since >= self.run.sensor_timeout)

    def show_suspension(self, status: Status, before: Suspension | None) -> None:
        """Publish the begin or end of a suspension; ``before`` is the suspension before this tick.

        The caller publishes a changed ``status`` itself.
        """
        if self.suspension is None:
            self._silent_since = None
        elif status is not RUNNING and not self.suspension.timed_out:  # it has an answer all the same
            self.suspension = None
        if status is RUNNING and self.status is RUNNING and (before is None or self.suspension is None):
            self.publish(RUNNING)

    def publish(self, status: Status) -> None:
        """Set a new status and notify the observer."""
        self.status = status
        if status is not RUNNING:
            self._silent_since = None
            if status is IDLE:
                self.suspension = None
        run = self.run
        if run.observer is not None:
            run.observer.on_status(run.clock.now(), run.tick, self, status, self.feedback_message)

    @abstractmethod
    def halt(self) -> bool:
        """Stop the node if it runs. Returns False while it still needs time; call it again at the next tick then."""

    def reset(self) -> None:
        """Clear the results of this node and of all nodes below. They must have ended: no actuator is stopped."""
        reset_all((self,))

    def clear_results(self, cleared: list["Node"]) -> None:
        """Clear the result without notifying the observer, and append each node that had one to ``cleared``."""
        status = self.status
        if status is not IDLE:
            if status is RUNNING:
                self.abandon_halt()
            self.feedback_message = ""
            self.status = IDLE
            self.suspension = self._silent_since = None
            cleared.append(self)

    @abstractmethod
    def abandon_halt(self) -> None:
        """Forget a halt in progress that takes too long; the caller has already stopped the actuators."""

    def tick(self) -> Iterator[Behaviour]:
        """Tick as py_trees does: execute one tick, then yield every node that has a status, this node last."""
        self.execute_tick()
        yield from (node for node in self.iterate() if node is self or node.status is not IDLE)

    def stop(self, new_status: Status = IDLE) -> None:
        """Stop as py_trees does, in one call. If the halt needs more time, the actuators are stopped at once."""
        if not self.halt():
            self.run.safe_stop(self.claims)
            self.reset()
        if self.status is not new_status:
            self.publish(new_status)


def reset_all(nodes: Iterable[Node]) -> None:
    """Reset several nodes, with one notification to the observer."""
    forgotten: list[Node] = []
    for node in nodes:
        node.clear_results(forgotten)
    if forgotten:
        run = forgotten[0].run
        if run.observer is not None:
            run.observer.on_reset(run.clock.now(), run.tick, forgotten)
