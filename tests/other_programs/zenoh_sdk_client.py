"""A node of ROS 2 by `zenoh_ros2_sdk` that has missions run: sends goals, hears feedback, cancels, asks for results.

Takes the port of a router, and missions; one that ends in "!" is cancelled. Prints what came of each, as JSON.
"""

import json
import os
import sys
import threading
from typing import Any

import numpy as np
import zenoh_sdk  # type: ignore[import-not-found]
from zenoh_ros2_sdk import ROS2ServiceClient, ROS2Subscriber

ROUTER = {"router_ip": "127.0.0.1", "router_port": int(sys.argv[1])}
RUN = "missiontree_msgs/action/RunMission"
UUID, INFO = "unique_identifier_msgs/msg/UUID", "action_msgs/msg/GoalInfo"
UUID_TEXT = "unique_identifier_msgs/UUID goal_id"
HASH = "RIHS01_" + "7" * 64  # as of a type that was built from another definition

running: list[str] = []
begun = threading.Event()


def on_feedback(told: Any) -> None:
    running.append(told.running)
    begun.set()


feedback = ROS2Subscriber(
    "/run_mission/_action/feedback",
    f"{RUN}_FeedbackMessage",
    on_feedback,
    zenoh_sdk.fields(f"{UUID_TEXT}\nstring running", UUID),
    type_hash=sys.argv[2],
    **ROUTER,
)
send = ROS2ServiceClient(
    "/run_mission/_action/send_goal",
    f"{RUN}_SendGoal",
    zenoh_sdk.fields(f"{UUID_TEXT}\nstring mission\nstring parameters", UUID),
    zenoh_sdk.fields("bool accepted\nbuiltin_interfaces/Time stamp", "builtin_interfaces/msg/Time"),
    type_hash=HASH,
    **ROUTER,
)
result = ROS2ServiceClient(
    "/run_mission/_action/get_result",
    f"{RUN}_GetResult",
    zenoh_sdk.fields(UUID_TEXT, UUID),
    "int8 status\nstring result\nstring reason",
    type_hash=HASH,
    timeout=60.0,
    **ROUTER,
)
cancel = ROS2ServiceClient(
    "/run_mission/_action/cancel_goal",
    "action_msgs/srv/CancelGoal",
    zenoh_sdk.fields("action_msgs/GoalInfo goal_info", INFO),
    zenoh_sdk.fields("int8 return_code\naction_msgs/GoalInfo[] goals_canceling", INFO),
    timeout=20.0,
    **ROUTER,
)

came = []
for number, mission in enumerate(sys.argv[3:]):
    running.clear()
    begun.clear()
    types = send.session_mgr.store.types
    uuid = types[UUID](uuid=np.full(16, number + 1, np.uint8))
    answer = send.call(goal_id=uuid, mission=mission.rstrip("!"), parameters="{}")
    accepted = bool(answer is not None and answer.accepted)
    told: dict[str, Any] = {"mission": mission, "accepted": accepted}
    if accepted and mission.endswith("!"):
        begun.wait(30.0)
        stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
        confirmed: Any = cancel.call(goal_info=types[INFO](goal_id=uuid, stamp=stamp))
        told["cancelled"] = len(confirmed.goals_canceling)
    if accepted:
        end: Any = result.call(goal_id=uuid)
        told |= {"status": int(end.status), "result": end.result, "reason": end.reason, "running": list(running)}
    came.append(told)
sys.stdout.write(json.dumps(came))
sys.stdout.flush()
os._exit(0)  # the session has threads that would go on
