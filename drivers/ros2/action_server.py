"""ROS 2 action server: receives goals, sends feedback and results. Also Nav2's error codes."""

from collections.abc import Callable, Mapping
from threading import RLock
from typing import Any

from drivers.ros2.node import Ros2Node
from drivers.ros2.types import MalformedMessage, types
from drivers.ros2.wire import CANCEL, CANCEL_KIND, FEEDBACK, RESULT, SEND, STATUS

# Results of actions in words; Nav2's nodes use ranges of error codes.

NAV2_ERRORS = {
    9000: "unknown error",
    9001: "cannot load its behaviour tree",
    9002: "the robot's pose on the map is unknown",
    9100: "unknown error",
    9101: "cannot load its behaviour tree",
    9102: "the robot's pose on the map is unknown",
    100: "its controller failed",
    101: "unknown controller",
    102: "the robot's pose on the map is unknown",
    103: "invalid path",
    104: "blocked for too long",
    105: "no progress",
    106: "no valid motion found",
    107: "the controller timed out",
    200: "its planner failed",
    201: "unknown planner",
    202: "the robot's pose on the map is unknown",
    203: "the start is outside of the map",
    204: "the goal is outside of the map",
    205: "the robot stands in an obstacle",
    206: "the goal lies in an obstacle",
    207: "the planner timed out",
    208: "no path to the goal",
    300: "its planner failed",
    301: "unknown planner",
    302: "the robot's pose on the map is unknown",
    303: "the start is outside of the map",
    304: "the goal is outside of the map",
    305: "the robot stands in an obstacle",
    306: "the goal lies in an obstacle",
    307: "the planner timed out",
    308: "no path to the goal",
    309: "no places were given",
}
"""Meanings of the error codes of Nav2's actions FollowPath, ComputePathToPose and ComputePathThroughPoses (Jazzy)."""


def failure_reason(kind: str, result: Any) -> str:
    """Return the reason for the failure of an action of type ``kind``, from its ``result``; empty if it has none."""
    if not isinstance(result, dict):
        return ""
    code, words = result.get("error_code", 0), result.get("error_msg", "")
    if not isinstance(code, int) or not code:
        return str(words)
    known = NAV2_ERRORS.get(code, "it failed") if kind.startswith("nav2_msgs/") else "it failed"
    return f"{known} (error {code}{f': {words}' if words else ''})"


def decode_result(kind: str, payload: bytes) -> tuple[int, Any]:
    """Return the final status and the result of an action of type ``kind``, decoded from ``payload``.

    If the sender's version of ROS 2 defines the result differently, the result is empty or has only an error code.
    """
    try:
        told = types().decode(f"{kind}_GetResult_Response", payload)
        return int(told.status), types().to_plain(told.result)
    except MalformedMessage:
        # The status comes first in any result; in Nav2's of Jazzy an error code follows.
        status = payload[4] if len(payload) > 4 else 0
        code = int.from_bytes(payload[6:8], "little") if len(payload) == 8 else None
        return status, {} if code is None else {"error_code": code}


UNKNOWN_GOAL, GOAL_TERMINATED = 2, 3
"""Reasons why no goal is cancelled, as action_msgs numbers them."""

EXECUTING, CANCELLING, SUCCEEDED, CANCELLED, ABORTED = 2, 3, 4, 5, 6
"""States of a goal, as action_msgs numbers them."""

MAX_KEPT_GOALS = 20
"""Maximum number of finished goals whose results the action server keeps."""

SendReply = Callable[[bytes], None]


class ActionGoal:
    """An accepted goal with its field ``values`` and its ``status``. Thread-safe."""

    def __init__(self, server: "ActionServer", uuid: list[int], values: Any) -> None:
        self.uuid, self.values = uuid, values
        self.status = EXECUTING
        self.result: Mapping[str, object] = {}
        self.pending_replies: list[SendReply] = []
        self._server = server

    @property
    def is_over(self) -> bool:
        """True once the goal has ended."""
        return self.status > CANCELLING

    def send_feedback(self, feedback: Mapping[str, object]) -> None:
        """Send feedback of this goal."""
        self._server.send_feedback(self, feedback)

    def end(self, status: int, result: Mapping[str, object]) -> None:
        """End the goal with the action_msgs ``status`` SUCCEEDED, CANCELLED or ABORTED, and its ``result``.

        Calls after the first one are ignored.
        """
        self._server.end(self, status, result)


class ActionServer:
    """Server of the action ``name`` of the ROS 2 type ``kind``, on a node.

    ``begin`` is called with each new goal, on a thread of Zenoh, and returns True to accept it. ``cancel`` is called
    with each goal that a client wants to cancel. Both must return at once.
    """

    def __init__(
        self,
        node: Ros2Node,
        name: str,
        kind: str,
        begin: Callable[[ActionGoal], bool],
        cancel: Callable[[ActionGoal], None],
    ) -> None:
        self._node, self._name, self._kind, self._begin, self._cancel = node, name, kind, begin, cancel
        self._lock = RLock()
        self._goals: list[ActionGoal] = []
        self._feedback = node.publisher(f"{name}/{FEEDBACK}", f"{kind}_FeedbackMessage")
        self._status = node.publisher(f"{name}/{STATUS}", "action_msgs/msg/GoalStatusArray")
        node.serve(f"{name}/{SEND}", f"{kind}_SendGoal", self._on_goal_request)
        node.serve(f"{name}/{RESULT}", f"{kind}_GetResult", self._on_result_request)
        node.serve(f"{name}/{CANCEL}", CANCEL_KIND, self._on_cancel_request)

    def send_feedback(self, goal: ActionGoal, feedback: Mapping[str, object]) -> None:
        """Send feedback of a goal."""
        values = {"goal_id": {"uuid": goal.uuid}, "feedback": feedback}
        self._feedback.send(types().encode(f"{self._kind}_FeedbackMessage", values))

    def end(self, goal: ActionGoal, status: int, result: Mapping[str, object]) -> None:
        """End a goal, and send its result to the clients that wait for it."""
        with self._lock:
            if goal.is_over:
                return
            goal.status, goal.result = status, result
            waiting, goal.pending_replies = goal.pending_replies, []
        self._send_result(goal, waiting)
        self._publish_status()

    def _on_goal_request(self, payload: bytes, send_reply: SendReply) -> None:
        try:
            told = types().decode(f"{self._kind}_SendGoal_Request", payload)
        except MalformedMessage as error:
            self._node.faults.add_for_topic(f"{self._name}/{SEND}", error)
            return
        goal = ActionGoal(self, told.goal_id.uuid.tolist(), told.goal)
        with self._lock:
            accepted = all(each.uuid != goal.uuid for each in self._goals) and self._begin(goal)
            if accepted:
                self._goals = [
                    *[each for each in self._goals if each.is_over][-MAX_KEPT_GOALS:],
                    *self._active_goals(),
                    goal,
                ]
        send_reply(types().encode(f"{self._kind}_SendGoal_Response", {"accepted": accepted}))
        self._publish_status()

    def _active_goals(self) -> list[ActionGoal]:
        return [each for each in self._goals if not each.is_over]

    def _on_result_request(self, payload: bytes, send_reply: SendReply) -> None:
        try:
            uuid = types().decode(f"{self._kind}_GetResult_Request", payload).goal_id.uuid.tolist()
        except MalformedMessage as error:
            self._node.faults.add_for_topic(f"{self._name}/{RESULT}", error)
            return
        with self._lock:
            goal = next((each for each in self._goals if each.uuid == uuid), None)
            if goal is not None and not goal.is_over:
                goal.pending_replies.append(send_reply)
                return
        if goal is None:
            send_reply(types().encode(f"{self._kind}_GetResult_Response", {"status": 0}))
        else:
            self._send_result(goal, [send_reply])

    def _on_cancel_request(self, payload: bytes, send_reply: SendReply) -> None:
        try:
            wanted = types().decode(f"{CANCEL_KIND}_Request", payload).goal_info.goal_id.uuid.tolist()
        except MalformedMessage as error:
            self._node.faults.add_for_topic(f"{self._name}/{CANCEL}", error)
            return
        with self._lock:
            known = [goal for goal in self._goals if wanted in (goal.uuid, [0] * 16)]
            meant = [goal for goal in known if not goal.is_over]
            for goal in meant:
                goal.status = CANCELLING
        told = [{"goal_id": {"uuid": goal.uuid}} for goal in meant]
        values = {"return_code": 0 if meant else GOAL_TERMINATED if known else UNKNOWN_GOAL, "goals_canceling": told}
        send_reply(types().encode(f"{CANCEL_KIND}_Response", values))
        for goal in meant:
            self._cancel(goal)

    def _send_result(self, goal: ActionGoal, waiting: list[SendReply]) -> None:
        payload = types().encode(f"{self._kind}_GetResult_Response", {"status": goal.status, "result": goal.result})
        for answer in waiting:
            answer(payload)

    def _publish_status(self) -> None:
        with self._lock:
            known = [{"goal_info": {"goal_id": {"uuid": each.uuid}}, "status": each.status} for each in self._goals]
        self._status.send(types().encode("action_msgs/msg/GoalStatusArray", {"status_list": known}))


def ignore_cancel(goal: ActionGoal) -> None:
    """Callback for cancelled goals that does nothing, for a server whose loop checks the status of its goal."""
