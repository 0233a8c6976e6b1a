"""How simulated time passes while the executive waits: as fast as it can, or at a pace that people can watch.

While the mission is paused it passes only as long as the robot has not come to rest, or somebody drives it.
"""

from collections.abc import Callable
from math import inf
from threading import Event
from typing import TYPE_CHECKING

from behaviours.robot import Robot
from behaviours.run import RunState
from drivers.clock import Clock

if TYPE_CHECKING:
    from drivers.sim.timeline import Timeline


MAX_LAG = 0.5
"""Seconds of real time that simulated time may be late and makes up for; after a pause it does not race."""

MAX_STILL_SPEED = 0.005
"""m/s and rad/s below which a base is at rest."""

MAX_STILL_TURN = 1e-4
"""Radians that a head at rest turns at most from one look to the next."""


class SimulationPacer:
    """Stands in for ``Run.wait``: waiting makes the simulated world go on, in the same thread.

    ``speed`` is how many times faster than real time it goes at most, by the run's ``wall`` clock, on which ``wait``
    waits.
    """

    def __init__(
        self, run: RunState, timeline: "Timeline", *, speed: float = inf, wait: Callable[[float], object] | None = None
    ) -> None:
        self._timeline = timeline
        self._woken = run.wake_event
        self._wall: Clock = run.wall
        self._speed = speed
        self._wait = Event().wait if wait is None else wait  # an event that is never set: to wait on
        self._start: tuple[float, float] | None = None

    def __call__(self, seconds: float) -> bool:
        """Let so much simulated time pass, or less when woken; say whether it was."""
        clock = self._timeline.clock
        if self._start is None:
            self._start = self._wall.now(), clock.now()
        self._timeline.run_until(clock.now() + seconds, self._woken.is_set)
        if self._speed < inf:
            wall, simulated = self._start
            ahead = (clock.now() - simulated) / self._speed - (self._wall.now() - wall)
            if ahead > 0:
                self._wait(ahead)
            elif ahead < -MAX_LAG:
                self._start = self._wall.now(), clock.now()
        return self._woken.is_set()


class PausedPacer:
    """Stands in for ``Executive.idle`` in simulated time: the world stands still once the robot is at rest.

    Until then, and while somebody drives by hand, time passes in the same thread: at ``speed``, and no faster than real
    time.
    """

    def __init__(
        self,
        run: RunState,
        timeline: "Timeline",
        robot: Robot,
        *,
        speed: float = inf,
        wait: Callable[[float], object] | None = None,
    ) -> None:
        self._pacer = SimulationPacer(run, timeline, speed=min(speed, 1.0), wait=wait)
        self._woken, self._robot = run.wake_event, robot
        self.is_driven: Callable[[], bool] = lambda: False
        """Whether somebody drives by hand."""
        self.on_wait: Callable[[], None] = lambda: None
        """Called after each wait, in the same thread: the robot may stand otherwise than at the last tick."""
        self._pan_tilt: tuple[float, float] | None = None

    def __call__(self, seconds: float) -> None:
        """Let so much time pass, simulated or real."""
        if self._is_moving() or self.is_driven():
            self._pacer(seconds)
        else:
            self._woken.wait(seconds)
        self.on_wait()

    def _is_moving(self) -> bool:
        """Say whether base, head or an arm still moves."""
        robot = self._robot
        turned, self._pan_tilt = self._pan_tilt, None
        head = None if robot.head_part is None else robot.head_part.pose().value
        if head is not None:
            self._pan_tilt = head.pan, head.tilt
            turned = turned or (inf, inf)  # at the first look it may turn
            if max(abs(head.pan - turned[0]), abs(head.tilt - turned[1])) > MAX_STILL_TURN:
                return True
        base = None if robot.base_part is None else robot.base_part.state().value
        if base is not None and max(abs(base.velocity.linear), abs(base.velocity.angular)) > MAX_STILL_SPEED:
            return True
        arms = [robot.arm_part, *(other.part for other in robot.extra_parts.values() if other.kind == "arm")]
        states = [state.value for arm in arms if arm is not None for state in arm.states().values()]
        return any(state is not None and state.moving for state in states)
