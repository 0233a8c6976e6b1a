"""Virtual joints of a robot with ROS 2: receive command frames of the topics, and return state frames."""

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from math import inf
from typing import Any

from drivers.ros2 import wire
from drivers.ros2.joint_topics import ARRAY, JOINT_STATE, SINGLE, TRAJECTORY, TopicJoint, joint_channels
from drivers.ros2.topic_port import TopicChannel
from drivers.ros2.types import MalformedMessage, types
from drivers.ros2.virtual_topics import VirtualTopics
from drivers.sim.servo import Shaft

STATE_INTERVAL = 0.02
"""Seconds between two joint state messages."""

MAX_MOTOR_SPEED = 6.0
"""Maximum speed of the virtual motors in rad/s."""


class VirtualJoints(VirtualTopics):
    """Virtual joints with a ROS 2 controller: of trajectories, as ``joint_trajectory_controller``, or of positions.

    ``states`` and ``command`` are topic names, ``kind`` is the type of the commands. The joints have their ROS names.
    As on real robots, the state messages also have a joint that the robot file does not list. ``command_count`` counts
    received commands.
    """

    def __init__(
        self,
        states: str,
        command: str,
        joints: Mapping[str, TopicJoint],
        *,
        full: Callable[[str], str] = wire.full_name,
        kind: str = TRAJECTORY,
        rates: bool = True,
    ) -> None:
        channels = joint_channels(states, command, joints, full)
        if channels[1].kinds != (SINGLE,):
            other = ARRAY if kind == TRAJECTORY else TRAJECTORY
            channels[1] = TopicChannel(channels[1].topic, (kind, other), is_command=True)
        super().__init__(channels)
        self.shafts = {joint.ros_name: Shaft(0.0, 0.0, MAX_MOTOR_SPEED) for joint in joints.values()}
        self.is_silent = False
        """True while the joints publish no states, but still receive commands."""
        self.command_count = 0
        self._rates = rates
        self._points: list[tuple[float, dict[str, float]]] = []  # time, and angle of each joint
        self._last_positions: dict[str, float] = {}
        self._due = self._states_sent_at = -inf

    def position(self, joint: str, now: float) -> float:
        """Return the true position (radians) of a joint, by its ROS name, at time ``now``."""
        with self._lock:
            self._advance(now)
            return self.shafts[joint].position

    def _handle_message(self, channel: int, payload: bytes, now: float) -> None:
        kind, names = self._kind(channel), list(self.shafts)
        try:
            told = types().decode(kind, payload)
        except MalformedMessage:
            return
        self._advance(now)
        self.command_count += 1
        if kind == TRAJECTORY:
            self._set_trajectory(told, now)
        elif kind == ARRAY:
            for name, place in zip(names, told.data, strict=True):
                self.shafts[name].goal = float(place)
        else:
            self.shafts[names[channel - 1]].goal = float(told.data)

    def _set_trajectory(self, message: Any, now: float) -> None:
        """Replace the current trajectory by a received one, starting at the current positions.

        Like a real controller, it ignores a trajectory that does not have all joints.
        """
        if set(message.joint_names) != set(self.shafts):  # as with allow_partial_joints_goal: false
            return
        self._points = [(now, {name: shaft.position for name, shaft in self.shafts.items()})]
        for point in message.points:
            when = now + point.time_from_start.sec + point.time_from_start.nanosec / 1e9
            self._points.append((when, dict(zip(message.joint_names, map(float, point.positions), strict=True))))

    def _advance(self, now: float) -> None:
        if self._points:
            for name, shaft in self.shafts.items():
                shaft.goal = _interpolate(self._points, name, now)
        for shaft in self.shafts.values():
            shaft.advance(now)

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        self._advance(now)
        if now < self._due or self.is_silent:
            return
        self._due = now + STATE_INTERVAL
        places = {name: shaft.position for name, shaft in self.shafts.items()}
        past, self._states_sent_at = now - self._states_sent_at, now
        rates = [(place - self._last_positions.get(name, place)) / past for name, place in places.items()]
        self._last_positions = places
        told = {
            "header": {"frame_id": "base_link"},
            "name": ["wheel_left_joint", *places],
            "position": [12.5, *places.values()],
            "velocity": [0.0, *rates] if self._rates else [],
        }
        yield 0, types().encode(JOINT_STATE, told)


def _interpolate(points: list[tuple[float, dict[str, float]]], name: str, now: float) -> float:
    for (begins, start), (ends, end) in pairwise(points):
        if now < ends:
            share = max(now - begins, 0.0) / (ends - begins)
            return start[name] + share * (end[name] - start[name])
    return points[-1][1][name]
