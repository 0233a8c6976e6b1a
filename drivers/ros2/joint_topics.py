"""Joint states and setpoints as ROS 2 messages."""

from collections.abc import Callable, Mapping
from math import degrees, inf, isnan, nan
from typing import Any

from drivers.api import DeviceStatus, JointLimits, JointState, Quality, Reading, StatusCallback
from drivers.api.fast_dataclass import dataclass
from drivers.joints.progress import JointProgress
from drivers.joints.request_checks import narrow_limits
from drivers.ros2 import wire
from drivers.ros2.declared import JOINT_PLACEHOLDER
from drivers.ros2.topic_port import TopicChannel
from drivers.ros2.types import types

JOINT_STATE = "sensor_msgs/msg/JointState"
TRAJECTORY, ARRAY, SINGLE = (
    "trajectory_msgs/msg/JointTrajectory",
    "std_msgs/msg/Float64MultiArray",
    "std_msgs/msg/Float64",
)

TRAJECTORY_HORIZON = 0.3
"""Maximum seconds of a trajectory that is sent: a joint that gets no further trajectory stops at its end."""

MIN_POINT_TIME = 0.05
"""Minimum seconds from now to the first point of a trajectory, for the controller to reach it."""

MIN_SPEED = 0.01
"""Minimum speed of a trajectory in rad/s."""

STALE_AFTER = 0.3
"""Seconds after which the reading of a joint is stale."""

OFFLINE_TIMEOUT = 0.4
"""Seconds without a reading after which a joint is offline, and no setpoints are sent."""

MOVING_SPEED = 0.02
"""Speed in rad/s from which on a joint counts as moving."""

MAX_PLAUSIBLE_VALUE = 1e6
"""Limit of plausible readings, in radians and rad/s."""

NO_TORQUE_OFF, NO_TORQUE_OFF_HINT = (
    "stays stiff: ROS 2 cannot switch its torque off",
    "use a service of its controller: `call_service`",
)
"""Notice and hint if joints are to be relaxed."""

RUNAWAY_NOTICE = "ROS 2 cannot switch its torque off, so its motor goes on"
RUNAWAY_HINT = "switch the power of its motor off; then check the signs of its motor, its sensor and its controller"
"""Hint in the fault of a joint that moves away from its goal."""

CLAMP_REPORT_INTERVAL = 10.0
"""Minimum seconds between two clamped goals of a joint that are both reported.

A goal within this time after another clamped one is not reported.
"""


@dataclass(frozen=True, slots=True)
class TopicJoint:
    """A joint of a robot with ROS 2: its name in ROS 2, its ``limits``, and its ``direction``.

    The direction is -1 if the angle in ROS 2 rises when the angle in the robot file falls.
    """

    ros_name: str
    limits: JointLimits
    direction: int = 1


def joint_channels(
    states: str, command: str, joints: Mapping[str, TopicJoint], full: Callable[[str], str] = wire.full_name
) -> list[TopicChannel]:
    """Return the topics of a joint group: that of their states, then those of their commands.

    ``states`` and ``command`` are topic names. If ``command`` contains ``{joint}``, each joint has a command topic.
    ``full`` returns the full name of a topic.
    """
    names, kinds = [command], [TRAJECTORY, ARRAY]
    if JOINT_PLACEHOLDER in command:
        names, kinds = [command.replace(JOINT_PLACEHOLDER, joint.ros_name) for joint in joints.values()], [SINGLE]
    commands = [TopicChannel(full(name), tuple(kinds), is_command=True) for name in names]
    return [TopicChannel(full(states), (JOINT_STATE,)), *commands]


@dataclass(frozen=True, slots=True)
class LinearTrajectory:
    """Motion of a joint at constant ``speed`` (rad/s), from ``start`` (radians) at ``start_time`` to ``goal``."""

    start: float
    start_time: float
    goal: float
    speed: float

    def position(self, now: float) -> float:
        """Return the setpoint at time ``now``."""
        reach = self.speed * max(now - self.start_time, 0.0)
        return self.start + min(max(self.goal - self.start, -reach), reach)

    def remaining_time(self, now: float) -> float:
        """Return the remaining seconds at ``now``; 0 at the goal."""
        return max(self.start_time + abs(self.goal - self.start) / self.speed - now, 0.0)


def trajectory_points(trajectories: Mapping[str, LinearTrajectory], now: float) -> list[tuple[float, dict[str, float]]]:
    """Return points of the joints for the next ``TRAJECTORY_HORIZON``: seconds from ``now``, and setpoints by joint.

    There is a point for the end of the horizon, and for each joint that reaches its goal before. Between points all
    joints move linearly.
    """
    times = sorted(
        {max(min(way.remaining_time(now), TRAJECTORY_HORIZON), MIN_POINT_TIME) for way in trajectories.values()}
    )
    return [(time, {name: way.position(now + time) for name, way in trajectories.items()}) for time in times]


def command_frames(
    kind: str,
    joints: Mapping[str, TopicJoint],
    trajectories: Mapping[str, LinearTrajectory],
    now: float,
    type_index: int = 0,
) -> bytes:
    """Return the frames of a command at ``now``, as messages of type ``kind``.

    A trajectory or an array is one message for all joints; otherwise each joint has one. ``type_index`` is the index of
    ``kind`` in the types of the channel.
    """
    if kind == TRAJECTORY:
        points = [
            {
                "positions": [joint.direction * places[name] for name, joint in joints.items()],
                "time_from_start": {"sec": 0, "nanosec": round(time * 1e9)},
            }
            for time, places in trajectory_points(trajectories, now)
        ]
        values = {"joint_names": [joint.ros_name for joint in joints.values()], "points": points}
        return wire.frame(1, types().encode(kind, values), type_index)
    places = [joint.direction * trajectories[name].position(now) for name, joint in joints.items()]
    if kind == ARRAY:
        return wire.frame(1, types().encode(kind, {"data": places}), type_index)
    told = (wire.frame(number, types().encode(SINGLE, {"data": place})) for number, place in enumerate(places, 1))
    return b"".join(told)


class JointFeedback:
    """Newest positions and velocities of ``joints``, from JointState messages."""

    def __init__(self, joints: Mapping[str, TopicJoint]) -> None:
        self._joints = joints
        self.unread_joints: set[str] = set()
        """Names in ROS 2 of the joints whose newest position is not a number (NaN)."""
        # Replaced, never modified: any thread may read it.
        self._latest: Mapping[str, tuple[float, float, float]] = {}  # position, velocity, time

    def __contains__(self, name: str) -> bool:
        return name in self._latest

    def update(self, message: Any, now: float) -> bool:
        """Store the joint states in a message; return True if it contained one of the joints.

        Raises ValueError or IndexError for implausible or missing values.
        """
        at, found = {there: place for place, there in enumerate(message.name)}, {}
        for name, joint in self._joints.items():
            if (place := at.get(joint.ros_name)) is None:
                continue
            position, before = joint.direction * float(message.position[place]), self._latest.get(name)
            if isnan(position):  # no reading yet
                self.unread_joints.add(joint.ros_name)
                continue
            self.unread_joints.discard(joint.ros_name)
            velocity = joint.direction * float(message.velocity[place]) if place < len(message.velocity) else nan
            if isnan(velocity):  # nor is measured
                since = 0.0 if before is None else now - before[2]
                velocity = (position - before[0]) / since if before is not None and since > 0 else 0.0
            if not (abs(position) < MAX_PLAUSIBLE_VALUE and abs(velocity) < MAX_PLAUSIBLE_VALUE):
                raise ValueError(
                    f"its joint {joint.ros_name} is at {position:g} rad, {velocity:g} rad/s, in {JOINT_STATE}"
                )
            found[name] = (position, velocity, now)
        self._latest = {**self._latest, **found}
        return bool(found)

    def position(self, name: str) -> float:
        """Return the newest position of a joint."""
        return self._latest[name][0]

    def is_moving(self, name: str) -> bool:
        """True if a joint moved at its newest reading."""
        return abs(self._latest[name][1]) > MOVING_SPEED

    def silent_joints(self, now: float) -> list[str]:
        """Return the joints that have no reading within the last ``OFFLINE_TIMEOUT`` seconds."""
        return [
            name for name in self._joints if name not in self._latest or now - self._latest[name][2] > OFFLINE_TIMEOUT
        ]

    def check_progress(self, name: str, progress: JointProgress) -> str:
        """Update ``progress`` with the newest position of a joint; return the fault that it finds, or an empty text."""
        if not progress.active or name not in self._latest:
            return ""
        position, _, stamp = self._latest[name]
        return progress.update(position, 0.0, stamp)

    def reading(
        self, name: str, trajectory: LinearTrajectory | None, now: float, *, online: bool, blocked: str = ""
    ) -> Reading[JointState]:
        """Return the state of a joint that follows ``trajectory`` (None: not commanded).

        It is stale if the part is not ``online`` or the reading is old. ``blocked`` is the reason why the joint is
        blocked. Load, voltage and temperature are always 0.
        """
        if name not in self._latest:
            return Reading(None, now, Quality.NONE)
        position, velocity, stamp = self._latest[name]
        moving = abs(velocity) > MOVING_SPEED or (
            online and trajectory is not None and trajectory.remaining_time(now) > 0
        )
        goal = None if trajectory is None else trajectory.goal
        state = JointState(position, velocity, goal, 0.0, 0.0, 0.0, moving, torque=True, blocked=blocked)
        return Reading(state, stamp, Quality.GOOD if online and now - stamp <= STALE_AFTER else Quality.STALE)


class TopicJointLimits:
    """Limits of ``joints``, which can be restricted; a clamped goal is reported as a fault of ``part``.

    Further clamped goals of a joint are reported only after ``CLAMP_REPORT_INTERVAL``.
    """

    def __init__(self, part: str, joints: Mapping[str, TopicJoint], report: StatusCallback) -> None:
        self._part, self._joints, self._report = part, joints, report
        self.limits: Mapping[str, JointLimits] = {name: joint.limits for name, joint in joints.items()}
        self._clamped_at: dict[str, float] = {}

    def restrict_limits(self, limits: Mapping[str, JointLimits]) -> Mapping[str, JointLimits]:
        """Restrict the limits of the named joints; see ``drivers.api.Limitable``."""
        widest = {name: joint.limits for name, joint in self._joints.items()}
        self.limits = {**self.limits, **narrow_limits(self._part, limits, widest)}
        return self.limits

    def clamp_goals(self, goals: Mapping[str, float], now: float) -> dict[str, float]:
        """Return the goals clamped to the limits of the joints, and report clamped goals."""
        accepted = {name: self.limits[name].clamp(goal) for name, goal in goals.items()}
        for name in (each for each in goals if accepted[each] != goals[each]):
            before, self._clamped_at[name] = self._clamped_at.get(name, -inf), now
            if now - before >= CLAMP_REPORT_INTERVAL:
                what = f"the goal of {name} was clamped to {degrees(accepted[name]):.1f} deg"
                what += f": {degrees(goals[name]):.1f} deg is beyond its limits"
                hint = "change the goal, or its limits in the robot file"
                self._report(DeviceStatus(self._part, "fault", what, hint))
        return accepted
