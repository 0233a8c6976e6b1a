"""What all nodes of one run share: the clock, the variables, and who watches."""

import logging
import random
from collections.abc import Callable
from threading import Event
from typing import TYPE_CHECKING

from drivers.clock import Clock

if TYPE_CHECKING:
    from behaviours.leaf import Leaf
    from behaviours.node import Node

log = logging.getLogger("missiontree")


class Run:
    """The shared state of one run of a mission.

    ``variables`` holds the params and what behaviours have stored; ``tick`` counts from 1, 0 before the first.
    ``observer`` is told of every node whose status has changed. ``preemptible`` are the running nodes that give way as
    soon as a leaf of higher priority is about to drive an actuator. ``settle`` brings the named actuators to rest when
    a leaf did not manage to in time.
    ``woken`` is set by whatever should not wait for the next scheduled tick. ``interruptible`` is true while a Ctrl-C
    comes as a KeyboardInterrupt.

    For who watches from another thread: ``alive_at`` is when the loop last showed that it goes on, ``working`` the leaf
    that has the word now. ``overheld`` says back which leaf held which tick for too long, and since when.
    """

    def __init__(self, clock: Clock, *, seed: int = 0) -> None:
        self.clock = clock
        self.tick = 0
        self.variables: dict[str, object] = {}
        self.random = random.Random(seed)  # noqa: S311 - the order of a random selector is no secret
        self.observer: Callable[[Node], None] | None = None
        self.preemptible: list[Node] = []
        self.settle: Callable[[frozenset[str]], None] = _nothing_to_settle
        self.woken = Event()
        self.interruptible = True
        self.alive_at = clock.now()
        self.working: Leaf | None = None
        self.overheld: tuple[Leaf, int, float] | None = None

    def now(self) -> float:
        """The time in seconds on the run's clock."""
        return self.clock.now()

    def beat(self) -> None:
        """Show that the loop goes on."""
        self.alive_at = self.clock.now()

    def wake(self) -> None:
        """Tick at once: something has happened that a behaviour may wait for. From any thread."""
        self.woken.set()

    def make_way(self) -> bool:
        """Halt what gives way to a leaf that is about to drive an actuator; False while that takes more ticks."""
        at_rest = True
        for node in self.preemptible:
            at_rest &= node.halt()
        return at_rest


def _nothing_to_settle(claims: frozenset[str]) -> None:
    """Do nothing: a run without a robot has no actuators."""
    del claims
