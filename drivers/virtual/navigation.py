"""A stand-in for Nav2 as ROS 2 sees it: its two actions, which drive a virtual base, and where that is on the map."""

from collections.abc import Callable, Iterable
from functools import partial
from math import atan2, cos, sin
from typing import Any

from drivers.api import Pose2D, Velocity
from drivers.ros2.graph import TF, THROUGH, TO_POSE
from drivers.ros2.line import Channel
from drivers.ros2.node import Node, Publisher
from drivers.ros2.requests import CANCEL, FEEDBACK, RESULT
from drivers.ros2.types import Malformed, types
from drivers.sim.navigator import ABORTED, NO_PROGRESS, Navigator
from drivers.virtual.topics import Topics, VirtualBase

FRAMES_PERIOD = 0.1
"""Seconds between two messages of where the robot is on the map."""

Answer = Callable[[bytes], None]


class _Goal:
    """A goal that is driven to."""

    def __init__(self, uuid: list[int], kind: str, frame: str, navigator: Navigator, feedback: Publisher) -> None:
        self.uuid, self.kind, self.frame, self.navigator, self.feedback = uuid, kind, frame, navigator, feedback
        self.waiting: list[Answer] = []
        self.told_at = -1.0


class VirtualNav2:
    """Serves Nav2's actions under ``names`` (to a pose, through poses), and drives ``base`` by them.

    ``rejects`` has it reject goals. ``goals`` are all that it has accepted.
    """

    def __init__(self, base: VirtualBase, names: tuple[str, str]) -> None:
        self.rejects = False
        self.goals: list[_Goal] = []
        self._base, self._names = base, names
        base.steered = self._steer

    def serve(self, node: Node) -> None:
        """Offer the actions on a node: also on a new one, when the router was away."""
        for name, kind in zip(self._names, (TO_POSE, THROUGH), strict=True):
            feedback = node.publisher(f"{name}/{FEEDBACK}", f"{kind}_FeedbackMessage")
            node.serve(f"{name}/_action/send_goal", f"{kind}_SendGoal", partial(self._begin, kind, feedback))
            node.serve(f"{name}/{RESULT}", f"{kind}_GetResult", self._result)
            node.serve(f"{name}/{CANCEL}", "action_msgs/srv/CancelGoal", self._cancel)

    def _begin(self, kind: str, feedback: Publisher, payload: bytes, answer: Answer) -> None:
        try:
            told = types().decode(f"{kind}_SendGoal_Request", payload)
        except Malformed:
            return
        poses = [told.goal.pose] if kind == TO_POSE else list(told.goal.poses)
        accepted = not self.rejects and bool(poses)
        if accepted:
            places = [_place(each) for each in poses]
            goal = _Goal(told.goal_id.uuid.tolist(), kind, poses[-1].header.frame_id, Navigator(places), feedback)
            for other in self.goals:
                other.navigator.cancel()  # one at a time: the newest
            self.goals.append(goal)
        answer(types().encode(f"{kind}_SendGoal_Response", {"accepted": accepted}))

    def _result(self, payload: bytes, answer: Answer) -> None:
        goal = self._find(f"{TO_POSE}_GetResult_Request", payload)
        if goal is None:
            return
        goal.waiting.append(answer)
        if goal.navigator.ended is not None:
            self._tell(goal)

    def _cancel(self, payload: bytes, answer: Answer) -> None:
        try:
            wanted = types().decode("action_msgs/srv/CancelGoal_Request", payload).goal_info.goal_id.uuid.tolist()
        except Malformed:
            return
        ended = [goal for goal in self.goals if wanted in (goal.uuid, [0] * 16) and goal.navigator.ended is None]
        for goal in ended:
            goal.navigator.cancel()
        told = [{"goal_id": {"uuid": goal.uuid}} for goal in ended]
        answer(types().encode("action_msgs/srv/CancelGoal_Response", {"goals_canceling": told}))

    def _find(self, kind: str, payload: bytes) -> _Goal | None:
        try:
            uuid = types().decode(kind, payload).goal_id.uuid.tolist()
        except Malformed:
            return None
        return next((goal for goal in self.goals if goal.uuid == uuid), None)

    def _steer(self, now: float, odometry: Pose2D) -> Velocity | None:
        """Say how the base is to drive; None where no goal is under way."""
        for goal in list(self.goals):
            if not goal.waiting and goal.navigator.ended is not None:
                continue
            pose = odometry if goal.frame == "odom" else self._base.pose(now)
            velocity = goal.navigator.velocity(now, pose)
            if velocity is None:
                self._tell(goal)
                return Velocity(0.0, 0.0)
            if now - goal.told_at >= FRAMES_PERIOD:
                goal.told_at = now
                left = {"distance_remaining": goal.navigator.distance(pose)}
                if goal.kind == THROUGH:
                    left["number_of_poses_remaining"] = goal.navigator.left
                values = {"goal_id": {"uuid": goal.uuid}, "feedback": left}
                goal.feedback.send(types().encode(f"{goal.kind}_FeedbackMessage", values))
            return velocity
        return None

    def _tell(self, goal: _Goal) -> None:
        waiting, goal.waiting = goal.waiting, []
        ended = goal.navigator.ended
        result = {"error_code": NO_PROGRESS if ended == ABORTED else 0}
        for answer in waiting:
            answer(types().encode(f"{goal.kind}_GetResult_Response", {"status": ended, "result": result}))


class VirtualFrames(Topics):
    """Tells by /tf where the robot's odometry is on the map, and where the robot is in its odometry."""

    def __init__(self, base: VirtualBase, topic: str) -> None:
        super().__init__([Channel(topic, (TF,))])
        self._base = base
        self._due = -1.0

    def _messages(self, now: float) -> Iterable[tuple[int, bytes]]:
        if now < self._due:
            return
        self._due = now + FRAMES_PERIOD
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


def _place(told: Any) -> tuple[float, float, float]:
    at, turned = told.pose.position, told.pose.orientation
    return at.x, at.y, 2 * atan2(turned.z, turned.w)
