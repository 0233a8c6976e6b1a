"""Runs one test case: a mission on twins, with mocks and faults, from its start until the robot is at rest."""

import math
from collections.abc import Callable
from dataclasses import replace

from drivers.api import HeadPose, Pose2D, Velocity
from drivers.api.joints import qualified_joint_name
from drivers.errors import DriverError, NotConnected
from missions.assembly.twins import Twins
from missions.executive.events import Ended, Event
from missions.executive.executive import Result
from missions.executive.watchdog import WatchdogLimits
from missions.language.expressions import ExpressionError
from missions.plugins.testing.case_history import CaseHistory
from missions.plugins.testing.fault_injector import FaultInjector
from missions.plugins.testing.mocks import MockSubstitution, find_left_out
from missions.plugins.testing.suite import Case
from missions.request import RunRequest
from missions.runner import Runner

REST_TIME = 1.0
"""Seconds after the mission's end within which the robot must come to rest."""

REST_CHECK_TIME = 0.1
"""Seconds, after ``REST_TIME``, for which no part of the robot may move."""

MAX_SWAY = 0.01
"""Distance in metres, and angle in radians, by which a robot in physics may sway during ``REST_CHECK_TIME``."""

Posture = tuple[Pose2D, HeadPose | None, dict[str, float]]

IN_PROCESS_LIMITS = WatchdogLimits(slow=math.inf, stall=math.inf, fail=10.0, lost=math.inf)
"""Watchdog limits for a run in a shared process: if a behaviour hangs, the run waits and the process is not ended."""


class CaseRunner:
    """Runs one test case, once. ``history`` records its events.

    ``violations`` are errors that fail any case, such as a robot that does not come to rest. The watchdog uses
    ``limits``; the default limits end the process if a behaviour hangs for good.
    """

    def __init__(self, case: Case, limits: WatchdogLimits | None = None) -> None:
        self.history = CaseHistory()
        self.violations: list[str] = []
        self._case = case
        self._limits = limits
        self._timeout_reason = ""

    def run(self) -> Runner:
        """Run the test case to its end, and let the robot come to rest.

        Raises InvalidFileError or UnknownNameError if its files have changed since they were read.
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
        runner = Runner(order, listeners=[history], limits=self._limits, substitute=MockSubstitution(case.mocks))
        twins = runner.twins
        if twins is None:
            raise TypeError("a run in simulated time has twins")
        history.left_out = find_left_out(runner.plan.tree, [mock.target for mock in case.mocks])
        history.attach(runner.root, _velocity_getter(twins))
        FaultInjector(runner, history).schedule(case.injected_faults)
        twins.timeline.call_at(case.timeout, lambda: self._stop(runner))
        try:
            history.result = runner.run()
        except DriverError:  # an incomplete robot: reported as the end of the run
            history.result = _result_from_events(history.events)
        if runner.stream.failed_listeners:  # a listener that raises gets no more events
            raise RuntimeError(f"some events were lost: {', '.join(runner.stream.failed_listeners)}")
        self._mark_running()
        history.returns = _mission_returns(runner)
        history.heard_by = _heard_by_person(twins)
        self._come_to_rest(twins)
        return runner

    def _stop(self, runner: Runner) -> None:
        self._timeout_reason = f"still running after {self._case.timeout:g} s of simulated time"
        runner.executive.stop(self._timeout_reason)

    def _mark_running(self) -> None:
        """Set the result to "running" if the timeout has ended the run; a violation if the case expects no result."""
        result, case = self.history.result, self._case
        if result is not None and self._timeout_reason and result.reason == self._timeout_reason:
            self.history.result = replace(result, result="running")
            if all(each.key != "result" for each in case.expectations):
                self.violations.append(self._timeout_reason)

    def _come_to_rest(self, twins: Twins) -> None:
        """Advance time until the robot is at rest; add a violation if it is not."""
        timeline, history = twins.timeline, self.history
        timeline.run_until(timeline.clock.now() + REST_TIME)
        history.pose = twins.pose() if "base" in twins.parts else None
        history.joints = _joint_angles(twins)
        before = _posture(twins)
        timeline.run_until(timeline.clock.now() + REST_CHECK_TIME)
        if not _is_still(before, _posture(twins), MAX_SWAY if twins.scene is not None else 0.0):
            self.violations.append(f"the robot was not at rest {REST_TIME:g} s after the end")
        if history.claim_conflict:
            self.violations.append(history.claim_conflict)


def _velocity_getter(twins: Twins) -> Callable[[], Velocity] | None:
    base, legs = twins.base, twins.legs
    if legs is not None:
        return lambda: legs.true_velocity
    return None if base is None else lambda: base.body.velocity


def _posture(twins: Twins) -> Posture:
    """Return the true poses of the twins now: base, head and joints."""
    head = None if twins.head is None else twins.head.true_pose(twins.timeline.clock.now())
    return twins.pose(), head, _joint_angles(twins)


def _is_still(before: Posture, after: Posture, max_sway: float) -> bool:
    """Return whether base, head and joints moved no farther than ``max_sway``, in metres and radians."""
    if not max_sway:
        return before == after
    (there, looked, were), (here, looks, are) = before, after
    moved = [abs(here.x - there.x), abs(here.y - there.y), *(abs(are[joint] - were[joint]) for joint in are)]
    if looked is not None and looks is not None:
        moved += [abs(looks.pan - looked.pan), abs(looks.tilt - looked.tilt)]
    return max(moved) <= max_sway


def _joint_angles(twins: Twins) -> dict[str, float]:
    now, arms = twins.timeline.clock.now(), twins.arms.items()
    return {qualified_joint_name(part, joint): arm.true_angle(joint, now) for part, arm in arms for joint in arm.limits}


def _heard_by_person(twins: Twins) -> dict[str, list[str]]:
    """Return the utterances of the robot that each person heard, in order."""
    world = twins.world
    return {
        each.name: [utterance.text for utterance in world.utterances if each.name in utterance.listeners]
        for each in world.people
    }


def _result_from_events(events: list[Event]) -> Result | None:
    for event in reversed(events):
        if isinstance(event, Ended):
            return Result(event.mission, event.result, event.reason, event.seconds, event.ticks)
    return None


def _mission_returns(runner: Runner) -> dict[str, object]:
    """Return the results of the mission by name; None for a result that could not be computed."""
    found: dict[str, object] = {}
    for name, value in runner.plan.returns.items():
        try:
            found[name] = value.resolve(runner.root.scope)
        except (ExpressionError, ValueError, NotConnected):  # it reads what was never set
            found[name] = None
    return found
