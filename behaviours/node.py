"""The node that all our behaviours and composites are: a py_trees behaviour that is ticked without generators.

py_trees drives its nodes through ``tick()``, a generator, and stops them through ``stop()``, which it also sends to
nodes that have ended already. Ours are driven through three plain methods instead: ``execute_tick``, ``halt``
(stop what is running, once, if need be over several ticks) and ``reset`` (forget an old result). ``tick()`` and
``stop()`` still work, so py_trees' own tools do too.
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
    """Why a node is suspended: ``reason`` is such as "the range finder does not report".

    ``timed_out`` is true in the tick in which the suspension has lasted for the run's sensor timeout. The node has failed
    then, or what is around it counts that otherwise (``retry`` tries again); a reactive composite above it fails.
    """

    reason: str
    timed_out: bool = False


def sensor_timeout_reason(reason: str, seconds: float) -> str:
    """Return the reason for a failure after a suspension of so many seconds."""
    limit = f"{seconds:g} s"
    if reason.endswith(NO_REPORT_SUFFIX):
        return f"{reason.removesuffix(NO_REPORT_SUFFIX)} has not reported for {limit}"
    return f"{reason} (waited for {limit})"


RUNNING, IDLE = Status.RUNNING, Status.INVALID  # looked up once: that takes ten times as long as to compare them


class Node(Behaviour):
    """A py_trees behaviour with a place in a mission.

    ``key`` is its stable id within the tree ("1.2"), ``kind`` the word of the mission language, ``line`` where it
    stands in ``file``. ``scope`` holds the variables of its mission. ``feedback_message``, py_trees' own, is the
    reason: why it failed, or what it waits for. ``visited_tick`` is the tick in which it was ticked last. ``suspension`` is
    why it could not answer then, where only a silent sensor was the cause.

    Each class declares which attributes of its own decide what it does next: ``run_state`` while it runs, and
    ``lasting_state`` at any time. ``mission verify`` takes nodes that are equal in these for the same.
    """

    run_state: ClassVar[tuple[str, ...]] = ()
    lasting_state: ClassVar[tuple[str, ...]] = ()
    key = ""
    kind = ""
    line = 0
    visited_tick = -1
    file = ""
    suspension: Suspension | None = None
    _silent_since: float | None = None
    run: RunState
    scope: dict[str, object]

    @property
    def reason(self) -> str:
        """Why it failed, or what it is waiting for."""
        return self.feedback_message

    @property
    def is_suspended(self) -> bool:
        """True while it runs only because a sensor has not reported."""
        return self.status is RUNNING and self.suspension is not None

    @property
    def is_skipped(self) -> bool:
        """True where it has succeeded without a start of its behaviour, which a condition has skipped."""
        return False

    @property
    def claims(self) -> frozenset[str]:
        """The actuators that it, or anything below it, may drive."""
        return frozenset().union(*(child.claims for child in self.children if isinstance(child, Node)))

    def execute_tick(self) -> Status:
        """Tick once and return the new status."""
        status = self.on_tick()
        if status is not self.status:
            self.publish(status)
        return status

    @abstractmethod
    def on_tick(self) -> Status:
        """Do one tick's work and return the new status, without publishing it yet."""

    def update(self) -> Status:
        """Do one tick's work, for py_trees, whose own tick asks for it; ours does not."""
        return self.on_tick()

    def pass_time(self) -> Status:
        """Let time pass in place of a tick, and return the new status; for a node that runs."""
        before = self.suspension
        status = self.on_time_passed()
        if status is not self.status or (self.suspension is None) is not (before is None):
            self.publish(status)
        return status

    def on_time_passed(self) -> Status:
        """Return the new status when only time has passed: deadlines count, nothing starts, no leaf is ticked."""
        return self.status

    def suspension_for(self, reason: str) -> Suspension:
        """Return the suspension of this tick; it is lost once the node was suspended for the sensor timeout."""
        now = self.run.now()
        if self._silent_since is None:
            self._silent_since = now
        return Suspension(reason, timed_out=now - self._silent_since >= self.run.sensor_timeout)

    def show_suspension(self, status: Status, before: Suspension | None) -> None:
        """Tell whoever watches where it is suspended now, or no more. A new ``status`` is told by who has ticked it."""
        if self.suspension is None:
            self._silent_since = None
        elif status is not RUNNING and not self.suspension.timed_out:  # it has an answer all the same
            self.suspension = None
        if status is RUNNING and self.status is RUNNING and (before is None or self.suspension is None):
            self.publish(RUNNING)

    def publish(self, status: Status) -> None:
        """Take on a new status, and tell whoever watches."""
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
        """Stop, if running; True once it is at rest. Call it again at the next tick while it is False."""

    def reset(self) -> None:
        """Forget the result of a run that has ended, and the results below. Nothing is told to stop: it has stopped."""
        reset_all((self,))

    def clear_results(self, cleared: list["Node"]) -> None:
        """Forget what ``reset`` is to forget, and add each node that had a result to ``forgotten``; tell nobody yet."""
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
        """Forget a halt that is under way: it takes too long, and the actuators were brought to rest for it."""

    def tick(self) -> Iterator[Behaviour]:
        """Tick as py_trees does: execute one tick, then yield every node that has a status, this one last."""
        self.execute_tick()
        yield from (node for node in self.iterate() if node is self or node.status is not IDLE)

    def stop(self, new_status: Status = IDLE) -> None:
        """Stop as py_trees does, which does not ask again: what takes more time is brought to rest for it."""
        if not self.halt():
            self.run.safe_stop(self.claims)
            self.reset()
        if self.status is not new_status:
            self.publish(new_status)


def reset_all(nodes: Iterable[Node]) -> None:
    """Reset several nodes at once; whoever watches is told of all together."""
    forgotten: list[Node] = []
    for node in nodes:
        node.clear_results(forgotten)
    if forgotten:
        run = forgotten[0].run
        if run.observer is not None:
            run.observer.on_reset(run.clock.now(), run.tick, forgotten)
