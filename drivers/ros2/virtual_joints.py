"""Joints of robots of ROS 2 at the far end of their topics. Frames in, frames out."""

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from math import inf
from typing import Any

from drivers.ros2 import wire
from drivers.ros2.line import Channel
from drivers.ros2.types import Malformed, types
from drivers.ros2.virtual_topics import Topics
from drivers.ros2.ways import ARRAY, SINGLE, STATE, TRAJECTORY, TopicJoint, channels_of
from drivers.sim.servo import Shaft

PERIOD = 0.02
"""Seconds between two messages of states."""

FASTEST = 6.0
"""rad/s that its motors make."""


class VirtualJoints(Topics):
    """Joints behind a controller of ROS 2: of trajectories, as ``joint_trajectory_controller`` is, or of positions.

    It names its joints as ROS 2 does, and tells besides of others, as robots do. ``heard`` counts what it was told.
    """

    def __init__(
        self,
        states: str,
        command: str,
        joints: Mapping[str, TopicJoint],
        *,
        full: Callable[[str], str] = wire.whole,
        kind: str = TRAJECTORY,
        rates: bool = True,
    ) -> None:
        channels = channels_of(states, command, joints, full)
        if channels[1].kinds != (SINGLE,):
            other = ARRAY if kind == TRAJECTORY else TRAJECTORY
            channels[1] = Channel(channels[1].topic, (kind, other), sends=True)
        super().__init__(channels)
        self.shafts = {joint.there: Shaft(0.0, 0.0, FASTEST) for joint in joints.values()}
        self.silent = False
        """True while it tells no states, and hears on."""
        self.heard = 0
        self._rates = rates
        self._points: list[tuple[float, dict[str, float]]] = []  # when, and where each is to be
        self._before: dict[str, float] = {}
        self._due = self._told_at = -inf

    def position(self, joint: str, now: float) -> float:
        """Where a joint, as ROS 2 calls it, really is at time ``now`` (radians)."""
        with self._lock:
            self._advance(now)
            return self.shafts[joint].position

    def _hear(self, channel: int, payload: bytes, now: float) -> None:
        kind, names = self._kind(channel), list(self.shafts)
        try:
            told = types().decode(kind, payload)
        except Malformed:
            return
        self._advance(now)
        self.heard += 1
        if kind == TRAJECTORY:
            self._follow(told, now)
        elif kind == ARRAY:
            for name, place in zip(names, told.data, strict=True):
                self.shafts[name].goal = float(place)
        else:
            self.shafts[names[channel - 1]].goal = float(told.data)

    def _follow(self, told: Any, now: float) -> None:
        """Take a trajectory in the place of the one before, as a controller does, from where it is."""
        if set(told.joint_names) != set(self.shafts):  # as with allow_partial_joints_goal: false
            return
        self._points = [(now, {name: shaft.position for name, shaft in self.shafts.items()})]
        for point in told.points:
            when = now + point.time_from_start.sec + point.time_from_start.nanosec / 1e9
            self._points.append((when, dict(zip(told.joint_names, map(float, point.positions), strict=True))))

    def _advance(self, now: float) -> None:
        if self._points:
            for name, shaft in self.shafts.items():
                shaft.goal = _between(self._points, name, now)
        for shaft in self.shafts.values():
            shaft.advance(now)

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        self._advance(now)
        if now < self._due or self.silent:
            return
        self._due = now + PERIOD
        places = {name: shaft.position for name, shaft in self.shafts.items()}
        past, self._told_at = now - self._told_at, now
        rates = [(place - self._before.get(name, place)) / past for name, place in places.items()]
        self._before = places
        told = {
            "header": {"frame_id": "base_link"},
            "name": ["wheel_left_joint", *places],
            "position": [12.5, *places.values()],
            "velocity": [0.0, *rates] if self._rates else [],
        }
        yield 0, types().encode(STATE, told)


def _between(points: list[tuple[float, dict[str, float]]], name: str, now: float) -> float:
    for (begins, start), (ends, end) in pairwise(points):
        if now < ends:
            share = max(now - begins, 0.0) / (ends - begins)
            return start[name] + share * (end[name] - start[name])
    return points[-1][1][name]
