"""One case on stage: a mission on twins, with mocks and mishaps, from its beginning until the robot is at rest."""

import math
from collections.abc import Callable

from drivers.api import HeadPose, Pose2D, Velocity
from drivers.api.joints import joint_called
from drivers.errors import DriverError, NotConnected
from missions.assembly.twins import Twins
from missions.executive.events import Ended, Event
from missions.executive.executive import Result
from missions.executive.watchdog import Limits
from missions.language.expressions import ExpressionError
from missions.plugins.testing.history import History
from missions.plugins.testing.mocks import Cast
from missions.plugins.testing.suite import Case
from missions.plugins.testing.trouble import Trouble
from missions.request import RunRequest
from missions.runner import Runner

REST_TIME = 1.0
"""Seconds after its end by which a robot must be at rest."""

STILL = 0.1
"""Seconds over which nothing may move then."""

SWAY = 0.01
"""Metres, and radians, by which a body that stands in physics may sway meanwhile."""

Posture = tuple[Pose2D, HeadPose | None, dict[str, float]]

IN_PROCESS = Limits(slow=math.inf, stall=math.inf, fail=10.0, lost=math.inf)
"""For a run in a process that has more to do: a behaviour that hangs is waited for, instead of ending the process."""


class Stage:
    """Runs one case, once. ``history`` is what has happened so far, ``wrong`` what must never be, whatever is expected.

    The watchdog keeps to ``limits``; its own ones end the process when a behaviour hangs for good.
    """

    def __init__(self, case: Case, limits: Limits | None = None) -> None:
        self.history = History()
        self.wrong: list[str] = []
        self._case = case
        self._limits = limits

    def run(self) -> Runner:
        """Run the case to its end, and let the robot come to rest.

        Raises InvalidFileError or UnknownNameError when its files are not what they were when it was read.
        """
        case, history = self._case, self.history
        order = RunRequest(
            case.mission,
            case.params,
            case.robot,
            "fast",
            case.world,
            seed=case.seed,
            behaviours=case.behaviours,
            eyes=case.eyes,
            physics=case.physics,
        )
        runner = Runner(order, listeners=[history], limits=self._limits, substitute=Cast(case.mocks))
        twins = runner.twins
        if twins is None:
            raise TypeError("a run in simulated time has twins")
        history.watch(runner.root, _velocity(twins))
        Trouble(runner, history).arrange(case.mishaps)
        twins.timeline.at(case.timeout, lambda: self._stop(runner))
        try:
            history.result = runner.run()
        except DriverError:  # a robot that is not complete: told as the end of the run
            history.result = _told_end(history.events)
        if runner.stream.lost:  # whoever raises is told no more, and so knows only half of it
            raise RuntimeError(f"not all events were heard: {', '.join(runner.stream.lost)}")
        history.returns = _returns(runner)
        history.heard_by = _heard_by(twins)
        self._come_to_rest(twins)
        return runner

    def _stop(self, runner: Runner) -> None:
        late = f"still running after {self._case.timeout:g} s of simulated time"
        self.wrong.append(late)
        runner.executive.stop(late)

    def _come_to_rest(self, twins: Twins) -> None:
        """Let the robot come to rest, and see whether it does."""
        timeline, history = twins.timeline, self.history
        timeline.run(timeline.clock.now() + REST_TIME)
        history.pose = twins.pose() if "base" in twins.parts else None
        history.joints = _joints(twins)
        before = _posture(twins)
        timeline.run(timeline.clock.now() + STILL)
        if not _still(before, _posture(twins), SWAY if twins.scene is not None else 0.0):
            self.wrong.append(f"the robot was not at rest {REST_TIME:g} s after the end")
        if history.claimed:
            self.wrong.append(history.claimed)


def _velocity(twins: Twins) -> Callable[[], Velocity] | None:
    base, legs = twins.base, twins.legs
    if legs is not None:
        return lambda: legs.true_velocity
    return None if base is None else lambda: base.body.velocity


def _posture(twins: Twins) -> Posture:
    """Return where base, head and joints truly are now."""
    head = None if twins.head is None else twins.head.true_pose(twins.timeline.clock.now())
    return twins.pose(), head, _joints(twins)


def _still(before: Posture, after: Posture, sway: float) -> bool:
    """Whether nothing moved farther than ``sway``, in metres and radians."""
    if not sway:
        return before == after
    (there, looked, were), (here, looks, are) = before, after
    moved = [abs(here.x - there.x), abs(here.y - there.y), *(abs(are[joint] - were[joint]) for joint in are)]
    if looked is not None and looks is not None:
        moved += [abs(looks.pan - looked.pan), abs(looks.tilt - looked.tilt)]
    return max(moved) <= sway


def _joints(twins: Twins) -> dict[str, float]:
    now, arms = twins.timeline.clock.now(), twins.arms.items()
    return {joint_called(part, joint): arm.true_angle(joint, now) for part, arm in arms for joint in arm.limits}


def _heard_by(twins: Twins) -> dict[str, list[str]]:
    """Return what each person heard the robot say, in order."""
    world = twins.world
    return {each.name: [heard.text for heard in world.heard if each.name in heard.by] for each in world.people}


def _told_end(events: list[Event]) -> Result | None:
    for event in reversed(events):
        if isinstance(event, Ended):
            return Result(event.mission, event.result, event.reason, event.seconds, event.ticks)
    return None


def _returns(runner: Runner) -> dict[str, object]:
    """Return the results of the mission, as far as they are known."""
    found: dict[str, object] = {}
    for name, value in runner.plan.returns.items():
        try:
            found[name] = value.resolve(runner.root.scope)
        except (ExpressionError, ValueError, NotConnected):  # it reads what was never set
            found[name] = None
    return found
