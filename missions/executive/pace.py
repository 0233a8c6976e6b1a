"""How simulated time passes while the executive waits: as fast as it can, or at a pace that people can watch."""

from collections.abc import Callable
from math import inf
from threading import Event
from typing import TYPE_CHECKING

from behaviours.run import Run
from drivers.clock import Clock

if TYPE_CHECKING:
    from drivers.sim.timeline import Timeline


class Pace:
    """Stands in for ``Run.wait``: waiting makes the simulated world go on, in the same thread.

    ``speed`` is how many times faster than real time it goes at most, by the run's ``wall`` clock, on which ``wait``
    waits.
    """

    def __init__(
        self, run: Run, timeline: "Timeline", *, speed: float = inf, wait: Callable[[float], object] | None = None
    ) -> None:
        self._timeline = timeline
        self._woken = run.woken
        self._wall: Clock = run.wall
        self._speed = speed
        self._wait = Event().wait if wait is None else wait  # an event that is never set: to wait on
        self._begun: tuple[float, float] | None = None

    def __call__(self, seconds: float) -> bool:
        """Let so much simulated time pass, or less when woken; say whether it was."""
        clock = self._timeline.clock
        if self._begun is None:
            self._begun = self._wall.now(), clock.now()
        self._timeline.run(clock.now() + seconds, self._woken.is_set)
        if self._speed < inf:
            wall, simulated = self._begun
            ahead = (clock.now() - simulated) / self._speed - (self._wall.now() - wall)
            if ahead > 0:
                self._wait(ahead)
        return self._woken.is_set()
