"""What all nodes of one run share: the clock, the variables, and who watches."""

import logging
import random
from collections.abc import Callable, Sequence
from threading import Event
from typing import TYPE_CHECKING, Protocol

from py_trees.common import Status

from drivers.clock import Clock

if TYPE_CHECKING:
    from behaviours.leaf import Leaf
    from behaviours.node import Node

log = logging.getLogger("missiontree")

DEAD_RECKONING_REASON = "by dead reckoning: nothing measured how far the base went"
"""Reason of a motion that succeeded on a base that measures nothing, and of its run."""

SENSOR_TIMEOUT = 5.0
"""Seconds after which a node fails that waits for a sensor to report, unless the robot file says otherwise."""


class NodeObserver(Protocol):
    """Who is told of every new status, at once and within the tick: it must neither wait nor raise.

    ``time`` is that of the change, on the run's clock; ``tick`` the tick that it came in.
    """

    def on_status(self, time: float, tick: int, node: "Node", status: Status, reason: str) -> None:
        """Hear that a node has a new status, and why."""

    def on_reset(self, time: float, tick: int, nodes: "Sequence[Node]") -> None:
        """Hear that several nodes, or one, have forgotten their results, in this order: all are idle now."""


class NodeCallback:
    """An observer that only wants to know which node has a new status; the node itself says which, and why."""

    def __init__(self, callback: Callable[["Node"], object]) -> None:
        self._callback = callback

    def on_status(self, time: float, tick: int, node: "Node", status: Status, reason: str) -> None:
        """See Observer."""
        del time, tick, status, reason
        self._callback(node)

    def on_reset(self, time: float, tick: int, nodes: "Sequence[Node]") -> None:
        """See Observer."""
        del time, tick
        for node in nodes:
            self._callback(node)


class RunState:
    """The shared state of one run of a mission.

    ``variables`` holds the params and what behaviours have stored; ``tick`` counts from 1, 0 before the first.
    ``observer`` is told of every new status. ``preemptible`` are the running nodes that give way as soon as a leaf of
    higher priority is about to drive an actuator. ``safe_stop`` brings the named actuators to rest when a leaf did not
    manage to in time. ``notify(text)`` tells somebody who is not there. ``wait(seconds)`` waits for so long or
    until woken, which it says: simulated time replaces it.
    ``sensor_timeout`` is how long (s) a node may be suspended because a sensor has not reported.
    ``wake_event`` is set by whatever should not wait for the next scheduled tick. ``interruptible`` is true while a Ctrl-C
    comes as a KeyboardInterrupt.

    While the executive ticks, time stands still: ``now`` is what it is ``tick_time`` at then; ``last_tick_at`` is when it
    ticked before, None in the first tick. ``variables_changed`` says that variables
    may have changed; who tells of that sets it back. ``dead_reckoned`` says that a motion has succeeded by dead reckoning.

    For who watches from another thread, by the ``wall`` clock (the run's own, unless that is a simulated one):
    ``heartbeat_at`` is when the loop last showed that it goes on, ``active_leaf`` the leaf that has the word now. ``overrun``
    says back which leaf held which tick for too long, and since when; ``overrun_failure`` the key of the leaf that has
    failed for it, and the seconds.
    """

    def __init__(self, clock: Clock, *, seed: int = 0, wall: Clock | None = None) -> None:
        self.clock = clock
        self.wall = clock if wall is None else wall
        self.tick = 0
        self.variables: dict[str, object] = {}
        self.random = random.Random(seed)  # noqa: S311 - the order of a random selector is no secret
        self.observer: NodeObserver | None = None
        self.preemptible: list[Node] = []
        self.safe_stop: Callable[[frozenset[str]], None] = _ignore_safe_stop
        self.notify: Callable[[str], None] = _log_notice
        self.wake_event = Event()
        self.wait: Callable[[float], bool] = self._wait
        self.interruptible = True
        self.heartbeat_at = self.wall.now()
        self.active_leaf: Leaf | None = None
        self.overrun: tuple[Leaf, int, float] | None = None
        self.overrun_failure: tuple[str, float] | None = None
        self.variables_changed = True
        self.dead_reckoned = False
        self.tick_time: float | None = None
        self.last_tick_at: float | None = None
        self.sensor_timeout = SENSOR_TIMEOUT

    def now(self) -> float:
        """The time in seconds on the run's clock, for the thread that ticks; others ask the ``clock``."""
        held = self.tick_time
        return self.clock.now() if held is None else held

    def record_heartbeat(self) -> None:
        """Show that the loop goes on."""
        self.heartbeat_at = self.wall.now()

    def wake(self) -> None:
        """Tick at once: something has happened that a behaviour may wait for. From any thread."""
        self.wake_event.set()

    def _wait(self, seconds: float) -> bool:
        return self.wake_event.wait(seconds)

    def preempt(self) -> bool:
        """Halt what gives way to a leaf that is about to drive an actuator; False while that takes more ticks."""
        at_rest = True
        for node in self.preemptible:
            at_rest &= node.halt()
        return at_rest


def _log_notice(text: str) -> None:
    """Log it: nobody watches this run."""
    log.info("notice: %s", text)


def _ignore_safe_stop(claims: frozenset[str]) -> None:
    """Do nothing: a run without a robot has no actuators."""
    del claims
