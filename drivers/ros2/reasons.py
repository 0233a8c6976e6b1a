"""How an action ended, and why one of Nav2 failed, in words: its error codes, which its nodes give in ranges."""

from typing import Any

from drivers.ros2.types import Malformed, types

CODES = {
    9000: "it does not know why",
    9001: "it could not load its behaviour tree",
    9002: "it does not know where the robot is on the map",
    9100: "it does not know why",
    9101: "it could not load its behaviour tree",
    9102: "it does not know where the robot is on the map",
    100: "its controller failed",
    101: "its controller is not known",
    102: "it does not know where the robot is on the map",
    103: "its path is no path",
    104: "it was blocked for too long",
    105: "it made no progress",
    106: "it found no way to move on",
    107: "its controller took too long",
    200: "its planner failed",
    201: "its planner is not known",
    202: "it does not know where the robot is on the map",
    203: "the start is outside of the map",
    204: "the goal is outside of the map",
    205: "the robot stands in an obstacle",
    206: "the goal lies in an obstacle",
    207: "its planner took too long",
    208: "there is no way to the goal",
    300: "its planner failed",
    301: "its planner is not known",
    302: "it does not know where the robot is on the map",
    303: "the start is outside of the map",
    304: "the goal is outside of the map",
    305: "the robot stands in an obstacle",
    306: "the goal lies in an obstacle",
    307: "its planner took too long",
    308: "there is no way to the goal",
    309: "it was given no places",
}
"""What the error codes of Nav2 mean (nav2_msgs of Jazzy: FollowPath, ComputePathToPose, ComputePathThroughPoses)."""


def reason(kind: str, result: Any) -> str:
    """Return why an action of this type ended as its result says; empty where that says nothing."""
    if not isinstance(result, dict):
        return ""
    code, words = result.get("error_code", 0), result.get("error_msg", "")
    if not isinstance(code, int) or not code:
        return str(words)
    known = CODES.get(code, "it failed") if kind.startswith("nav2_msgs/") else "it failed"
    return f"{known} (error {code}{f': {words}' if words else ''})"


def result_of(kind: str, payload: bytes) -> tuple[int, Any]:
    """Return the status of an action's end, and its result: nothing of one that another ROS 2 defines otherwise."""
    try:
        told = types().decode(f"{kind}_GetResult_Response", payload)
        return int(told.status), types().values(told.result)
    except Malformed:
        # The status stands first, whatever follows; of Nav2's result of Jazzy, an error code.
        status = payload[4] if len(payload) > 4 else 0
        code = int.from_bytes(payload[6:8], "little") if len(payload) == 8 else None
        return status, {} if code is None else {"error_code": code}
