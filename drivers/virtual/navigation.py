"""A stand-in for Nav2 and a Create 3's docking as ROS 2 sees them: actions that drive a virtual base, and its place."""

from collections.abc import Iterable
from functools import partial
from math import atan2, cos, pi, sin
from typing import Any

from drivers.api import BASE_RADIUS, STILL, Pose2D, Velocity
from drivers.ros2.actions import CANCELLING, SUCCEEDED, ActionServer, Goal, ignored
from drivers.ros2.graph import TF, THROUGH, TO_POSE
from drivers.ros2.line import Channel
from drivers.ros2.node import Node
from drivers.ros2.types import types
from drivers.sim.dock import SIZE, Dock
from drivers.sim.navigator import ABORTED, NO_PROGRESS, Navigator
from drivers.virtual.topics import Topics, VirtualBase

TOLD_PERIOD = 0.1
"""Seconds between two messages of feedback, and of where the robot is on the map."""


DOCK = "irobot_create_msgs/action/Dock"


class VirtualNav2:
    """Serves actions under ``names`` (to a pose, through poses, onto the ``dock``), and drives ``base`` by them.

    ``rejects`` has it reject goals.
    """

    def __init__(self, base: VirtualBase, names: tuple[str, str, str], dock: Dock | None = None) -> None:
        self.rejects = False
        self._base, self._names, self._dock = base, names, dock
        self._goal: tuple[Goal, Navigator, str] | None = None
        self._told_at = -1.0
        base.steered = self._steer

    def serve(self, node: Node) -> None:
        """Offer the actions on a node: also on a new one, when the router was away."""
        for name, kind in zip(self._names, (TO_POSE, THROUGH, DOCK), strict=True):
            ActionServer(node, name, kind, partial(self._begin, kind), ignored)

    def _begin(self, kind: str, goal: Goal) -> bool:
        if kind == DOCK:
            places, frame = _onto(self._dock), DOCK
        else:
            poses = [goal.values.pose] if kind == TO_POSE else list(goal.values.poses)
            places, frame = [_place(each) for each in poses], poses[-1].header.frame_id if poses else ""
        if self.rejects or not places:
            return False
        before, self._goal = self._goal, (goal, Navigator(places), frame)
        if before is not None:
            before[0].end(ABORTED, {})  # one at a time: the newest
        return True

    def _steer(self, now: float, odometry: Pose2D) -> Velocity | None:
        """Say how the base is to drive; None where no goal is under way."""
        if self._goal is None:
            return None
        goal, navigator, frame = self._goal
        if goal.status == CANCELLING:
            navigator.cancel()
        pose = odometry if frame == "odom" else self._base.pose(now)
        docks, docked = frame == DOCK, self._base.body.docked
        velocity = None if docks and docked else navigator.velocity(now, pose)
        if velocity is None:
            self._goal = None
            ended = navigator.ended or SUCCEEDED
            if docks:
                goal.end(ABORTED if ended == SUCCEEDED and not docked else ended, {"is_docked": docked})
            else:
                goal.end(ended, {"error_code": NO_PROGRESS if ended == ABORTED else 0})
            return STILL
        if now - self._told_at >= TOLD_PERIOD:
            self._told_at = now
            goal.tell({"sees_dock": True} if docks else {"distance_remaining": navigator.distance(pose)})
        return velocity


class VirtualFrames(Topics):
    """Tells by /tf where the robot's odometry is on the map, and where the robot is in its odometry."""

    def __init__(self, base: VirtualBase, topic: str) -> None:
        super().__init__([Channel(topic, (TF,))])
        self._base = base
        self._due = -1.0

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        if now < self._due:
            return
        self._due = now + TOLD_PERIOD
        true, own = self._base.pose(now), self._base.odometry
        turn = true.heading - own.heading
        x = true.x - (own.x * cos(turn) - own.y * sin(turn))
        y = true.y - (own.x * sin(turn) + own.y * cos(turn))
        transforms = [_transform("map", "odom", Pose2D(x, y, turn)), _transform("odom", "base_link", own)]
        yield 0, types().encode(TF, {"transforms": transforms})


def _transform(frame: str, child: str, pose: Pose2D) -> dict[str, object]:
    turned = {"z": sin(pose.heading / 2), "w": cos(pose.heading / 2)}
    at = {"translation": {"x": pose.x, "y": pose.y}, "rotation": turned}
    return {"header": {"frame_id": frame}, "child_frame_id": child, "transform": at}


def _onto(dock: Dock | None) -> list[tuple[float, float, float]]:
    """Return the way onto a dock: from before it to a little beyond where the contacts meet."""
    away = () if dock is None else (0.6, SIZE[0] / 2 + BASE_RADIUS - 0.04)
    return [
        (dock.x + it * cos(dock.heading), dock.y + it * sin(dock.heading), dock.heading + pi) for it in away if dock
    ]


def _place(told: Any) -> tuple[float, float, float]:
    at, turned = told.pose.position, told.pose.orientation
    return at.x, at.y, 2 * atan2(turned.z, turned.w)
