"""Shared state of the nodes of one run: clock, variables and observer."""

import logging
import random
from collections.abc import Callable, Collection, Sequence
from threading import Event
from typing import TYPE_CHECKING, Protocol

from py_trees.common import Status

from drivers.clock import Clock

if TYPE_CHECKING:
    from behaviours.leaf import Leaf
    from behaviours.node import Node

log = logging.getLogger("missiontree")

DEAD_RECKONING_REASON = "by dead reckoning: nothing measured how far the base went"
"""Reason of a motion, and of its run, that succeeded on a base without odometry."""

SENSOR_TIMEOUT = 5.0
"""Default of the robot file's `sensor_timeout` in seconds: then a node that waits for a sensor fails."""


class NodeObserver(Protocol):
    """Observer of status changes. It is called within the tick, so it must neither wait nor raise.

    ``time`` is the time of the change on the run's clock; ``tick`` is the number of the tick.
    """

    def on_status(self, time: float, tick: int, node: "Node", status: Status, reason: str) -> None:
        """Called when ``node`` has a new status, with the reason of the status."""

    def on_reset(self, time: float, tick: int, nodes: "Sequence[Node]") -> None:
        """Called when ``nodes`` were reset, in this order; all of them are idle now."""


class NodeCallback:
    """Observer that calls a function with each node whose status has changed."""

    def __init__(self, callback: Callable[["Node"], object]) -> None:
        self._callback = callback

    def on_status(self, time: float, tick: int, node: "Node", status: Status, reason: str) -> None:
        del time, tick, status, reason
        self._callback(node)

    def on_reset(self, time: float, tick: int, nodes: "Sequence[Node]") -> None:
        del time, tick
        for node in nodes:
            self._callback(node)


class RunState:
    """Shared state of one run of a mission.

    - ``variables``: the params, and the outputs of behaviours
    - ``tick``: number of the tick, from 1; 0 before the first
    - ``observer``: is notified of every new status
    - ``preemptible``: running children of reactive composites, which are halted when a leaf of an earlier child is
      about to act
    - ``safe_stop``: stops the named actuators if a leaf did not do so in time
    - ``notify(text)``: sends a notice to a person
    - ``wait(seconds)``: waits for the time or for ``wake_event``, and returns whether that is set; simulated time
      replaces it
    - ``sensor_timeout``: seconds for which a node may be suspended
    - ``wake_event``: starts the next tick early
    - ``interruptible``: true while a Ctrl-C arrives as a KeyboardInterrupt
    - ``tick_time``: time at which the clock is frozen during a tick, else None
    - ``last_tick_at``: time of the tick before, None in the first
    - ``variables_changed``: set when variables may have changed; the reporter clears it
    - ``is_held``: true in a pause, and after the end, so that no thread of a leaf may move anything
    - ``dead_reckoned``: set when a motion has succeeded by dead reckoning

    For observers in other threads, on the ``wall`` clock (the run's own, unless that is simulated): ``heartbeat_at`` is
    the time of the loop's last heartbeat, ``active_leaf`` the leaf that executes now. The watchdog sets ``overrun``:
    leaf, tick and start of a tick that takes too long. ``overrun_failure`` is the key of the leaf that failed for it,
    and the seconds.
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
        self.is_held = False
        self.dead_reckoned = False
        self.tick_time: float | None = None
        self.last_tick_at: float | None = None
        self.sensor_timeout = SENSOR_TIMEOUT

    def now(self) -> float:
        """Return the time in seconds on the run's clock, for the ticking thread; other threads read ``clock``."""
        held = self.tick_time
        return self.clock.now() if held is None else held

    def record_heartbeat(self) -> None:
        """Record the time at which the tick loop was last alive, for the watchdog."""
        self.heartbeat_at = self.wall.now()

    def wake(self) -> None:
        """Let the next tick start at once, because an event has happened that a behaviour may wait for. Thread-safe."""
        self.wake_event.set()

    def _wait(self, seconds: float) -> bool:
        return self.wake_event.wait(seconds)

    def preempt(self, composites: Collection[str] | None = None) -> bool:
        """Halt the preemptible nodes for a leaf that is about to act; return False while that takes more ticks.

        ``composites`` are the keys of the reactive composites whose running child is halted; None for all.
        """
        at_rest = True
        for node in self.preemptible:
            if composites is None or node.key.rpartition(".")[0] in composites:
                at_rest &= node.halt()
        return at_rest


def _log_notice(text: str) -> None:
    """Log the text of a notice: the default for runs that cannot deliver notices to a person."""
    log.info("notice: %s", text)


def _ignore_safe_stop(claims: frozenset[str]) -> None:
    """Do nothing: a run without a robot has no actuators."""
    del claims
