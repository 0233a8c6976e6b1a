"""Simulated robot with ROS 2: its nodes with a stand-in for Nav2, its base and range finder."""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

from drivers.api import GoalState, Health, Pose2D, Progress, Quality, Reading, StatusCallback, ignore
from drivers.api.ros2 import START_FRAME, MapPose
from drivers.api.sections import Ros2Keys
from drivers.base.range_twin import RangerTwin
from drivers.base.reckoning import TwoWheels
from drivers.base.twin import BaseTwin, WheelTwinOdometry, make_wheel_base
from drivers.base.twin import make as make_twin
from drivers.clock import Clock
from drivers.errors import BadRequest, DriverError, NotConnected
from drivers.ros2.action_server import failure_reason
from drivers.ros2.declared import Ros2BaseKeys, Ros2RangeKeys, ZenohKeys
from drivers.ros2.requests import GOAL_STATES
from drivers.sim.context import SimContext
from drivers.sim.navigator import NO_PROGRESS_ERROR, Navigator
from drivers.sim.plug import SimulatedPlug
from drivers.sim.scanner import make_range_function
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import BackupLimit

MAX_WHEEL_SPEED = 100.0
"""Maximum wheel speed in m/s of the simulated wheels, which is too high to ever limit a base."""


@dataclass(slots=True)
class _NavigationGoal:
    """Goal of the simulated Nav2, with its progress."""

    navigator: Navigator
    frame: str
    name: str
    progress: Progress


class Ros2Twin:
    """Simulated ROS 2 nodes: a ``drivers.api.Ros2`` whose only actions are those of Nav2.

    They drive the simulated base straight to a place. There are no services. ``published`` lists the sent messages as
    (topic, type, values).
    """

    name = "ros2"
    STEP_INTERVAL = 0.05
    """Seconds between two steps."""

    def __init__(
        self, keys: Ros2Keys, clock: Clock, base: Callable[[], BaseTwin | None], report: StatusCallback = ignore
    ) -> None:
        self.plug = SimulatedPlug(self.name, report, on_offline=self.stop)
        self.published: list[tuple[str, str, str]] = []
        self._keys, self._clock, self._base = keys, clock, base
        self._numbers = count(1)
        self._goals: dict[int, _NavigationGoal] = {}

    def open(self) -> None:
        """Connect at once, unless the simulated plug is pulled."""
        self.plug.open()

    def rest(self) -> None:
        """Cancel all goals."""
        self.stop()

    def close(self) -> None:
        """Cancel all goals, and disconnect."""
        self.stop()
        self.step()
        self.plug.close()

    def health(self) -> Health:
        """Return whether the simulated nodes are connected."""
        return self.plug.health({})

    def nodes(self) -> int:
        """Return the number of simulated ROS 2 nodes."""
        return 1 if self.plug.online else 0

    def does(self, name: str) -> bool:
        """True if ``name`` is one of Nav2's actions, while connected."""
        return self.plug.online and name in {self._keys.navigation, self._keys.through}

    offers = does

    def navigates(self) -> bool:
        """True while Nav2 is available."""
        return self.plug.online

    def latest(self, topic: str) -> Reading[str]:
        """Return the newest message that was published on a topic by this object; the value is None without one."""
        values = next((each[2] for each in reversed(self.published) if each[0] == topic), None)
        now = self._clock.now()
        return Reading(values, now, Quality.NONE if values is None else Quality.GOOD)

    def progress(self, number: int) -> Progress:
        """Return the progress of a goal. Raises BadRequest for an unknown number."""
        if number not in self._goals:
            raise BadRequest(f"ros2: unknown request {number}")
        return self._goals[number].progress

    def publish(self, topic: str, kind: str, values: str) -> None:
        """Store a message in ``published``."""
        self.plug.check_online()
        self.published.append((topic, kind, values))

    def call(self, service: str, kind: str, values: str) -> int:
        """Raise NotConnected: there are no services."""
        del kind, values
        raise NotConnected(f"ros2: no server of {service}: this robot is simulated", hint="run it with --simulate wire")

    def begin(self, action: str, kind: str, goal: str) -> int:
        """Begin Nav2's navigation action; return its number. Raises NotConnected for another action."""
        del kind
        if action != self._keys.navigation:
            what = f"ros2: no server of {action}: this robot is simulated"
            raise NotConnected(what, hint="run it with --simulate wire")
        pose = json.loads(goal or "{}").get("pose", {})
        at = pose.get("pose", {}).get("position", {})
        place = (float(at.get("x", 0.0)), float(at.get("y", 0.0)), 0.0)
        return self.navigate((place,), pose.get("header", {}).get("frame_id", "map"))

    def navigate(self, places: tuple[MapPose, ...], frame: str) -> int:
        """Begin to drive to the last place, through the others; return the number of the goal."""
        self.plug.check_online()
        number = next(self._numbers)
        name = self._keys.navigation if len(places) == 1 else self._keys.through
        self._goals[number] = _NavigationGoal(Navigator(places), frame, name, Progress(GoalState.RUNNING))
        return number

    def cancel(self, number: int) -> None:
        """Cancel a goal: it ends at the next step."""
        drive = self._goals.get(number)
        if drive is not None and not drive.progress.is_final:
            drive.navigator.cancel()
            drive.progress = replace(drive.progress, state=GoalState.CANCELLING)

    def stop(self) -> None:
        """Cancel all goals."""
        for number in list(self._goals):
            self.cancel(number)

    def step(self) -> None:
        """Advance all goals."""
        base = self._base()
        for drive in list(self._goals.values()):
            if not drive.progress.is_final and base is not None:
                self._advance_goal(drive, base)

    def _advance_goal(self, goal: _NavigationGoal, base: BaseTwin) -> None:
        state = base.state().value
        now, navigator = self._clock.now(), goal.navigator
        if state is None:
            return
        pose: Pose2D = state.pose if goal.frame in {START_FRAME, "odom"} else base.true_pose(now)
        velocity = navigator.next_velocity(now, pose)
        if velocity is not None:
            feedback = {"distance_remaining": round(navigator.distance_to_next(pose), 3), "number_of_recoveries": 0}
            feedback["number_of_poses_remaining"] = navigator.remaining
            goal.progress = replace(goal.progress, feedback=json.dumps(feedback))
            try:
                base.drive(velocity)
            except DriverError:  # latched or away: it makes no progress, and fails in the end
                return
            return
        base.stop()
        ended = GOAL_STATES[navigator.result or 0]
        result: dict[str, Any] = {"error_code": NO_PROGRESS_ERROR if ended is GoalState.FAILED else 0, "error_msg": ""}
        why = failure_reason("nav2_msgs/", result)
        told = f"{goal.name}: {why}" if why else ""
        goal.progress = Progress(ended, told, goal.progress.feedback, json.dumps(result))


def graph(keys: ZenohKeys, stage: SimContext) -> Ros2Twin:
    """Return the simulated nodes of a robot."""
    return Ros2Twin(keys, stage.clock, lambda: stage.parts.get("base"), stage.report)


def base(keys: Ros2BaseKeys, stage: SimContext) -> BaseTwin:
    """Return the simulated base. It has the contacts of a Kobuki if the robot file has the key ``hazards``."""
    if keys.hazards:
        twin = make_twin(keys, stage)
        twin.body.backup_limit = BackupLimit()
        return twin
    odometry = WheelTwinOdometry(TwoWheels(0.2, MAX_WHEEL_SPEED), reckoned=False, gyro=True)
    return make_wheel_base(keys, stage, odometry, gauge=bool(keys.battery))


def ranger(keys: Ros2RangeKeys, stage: SimContext) -> RangerTwin:
    """Return the simulated range finder."""
    world = SimulatedWorld() if stage.world is None else stage.world
    return RangerTwin(
        make_range_function(world, keys.place, stage.pose, height=keys.position[2]),
        stage.clock,
        place=keys.place,
        blind=keys.blind,
        report=stage.report,
        seed=stage.seed,
    )
