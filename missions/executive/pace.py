"""Simulated time while the executive waits: as fast as possible, or at a multiple of real time.

While the mission is paused, time passes only until the robot is at rest, or while a person drives it.
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
"""Maximum seconds that simulated time makes up for after a delay; after a longer one it continues at normal speed."""

MAX_STILL_SPEED = 0.005
"""Speed in m/s and rad/s below which a base is at rest."""

MAX_STILL_TURN = 1e-4
"""Maximum turn in radians of a head at rest between two checks."""


class SimulationPacer:
    """Replacement for ``Run.wait`` that advances the simulated world in the same thread.

    ``speed`` is the maximum ratio of simulated to real time; ``wait`` is a function that waits in real time (s).
    """

    def __init__(
        self, run: RunState, timeline: "Timeline", *, speed: float = inf, wait: Callable[[float], object] | None = None
    ) -> None:
        self._timeline = timeline
        self._woken = run.wake_event
        self._wall: Clock = run.wall
        self._speed = speed
        self._wait = Event().wait if wait is None else wait  # the event is never set: only its timeout is used
        self._start: tuple[float, float] | None = None

    def __call__(self, seconds: float) -> bool:
        """Advance simulated time by ``seconds``, or until woken; return whether it was woken."""
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
    """Replacement for ``Executive.idle`` in simulated time: the world stops once the robot is at rest.

    Until then, and while a person drives, time passes in the same thread, at ``speed`` and at most in real time.
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
        """Function that returns True while a person drives the robot by hand."""
        self.on_wait: Callable[[], None] = lambda: None
        """Called after each wait, in the same thread: the robot may have moved since the last tick."""
        self._pan_tilt: tuple[float, float] | None = None

    def __call__(self, seconds: float) -> None:
        """Wait for ``seconds``, simulated or real."""
        if self._is_moving() or self.is_driven():
            self._pacer(seconds)
        else:
            self._woken.wait(seconds)
        self.on_wait()

    def _is_moving(self) -> bool:
        """Return True if base, head or an arm of the simulated robot moves."""
        robot = self._robot
        turned, self._pan_tilt = self._pan_tilt, None
        head = None if robot.head_part is None else robot.head_part.pose().value
        if head is not None:
            self._pan_tilt = head.pan, head.tilt
            turned = turned or (inf, inf)  # the first picture may be taken while the head turns
            if max(abs(head.pan - turned[0]), abs(head.tilt - turned[1])) > MAX_STILL_TURN:
                return True
        base = None if robot.base_part is None else robot.base_part.state().value
        if base is not None and max(abs(base.velocity.linear), abs(base.velocity.angular)) > MAX_STILL_SPEED:
            return True
        arms = [robot.arm_part, *(other.part for other in robot.extra_parts.values() if other.kind == "arm")]
        states = [state.value for arm in arms if arm is not None for state in arm.states().values()]
        return any(state is not None and state.moving for state in states)
