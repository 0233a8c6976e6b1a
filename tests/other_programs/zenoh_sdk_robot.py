"""A robot of ROS 2 by `zenoh_ros2_sdk`: odometry, scans, a Twist to obey, and Nav2's action. Ends with its stdin.

Prints what it has heard, as JSON.
"""

import json
import os
import sys
import threading
import time
from contextlib import suppress
from typing import Any

import numpy as np
import zenoh_sdk  # type: ignore[import-not-found]
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceServer, ROS2Subscriber

PORT = int(sys.argv[1])
ROUTER = {"router_ip": "127.0.0.1", "router_port": PORT}
NAV = "nav2_msgs/action/NavigateToPose"
POSE, UUID, INFO = "geometry_msgs/msg/PoseStamped", "unique_identifier_msgs/msg/UUID", "action_msgs/msg/GoalInfo"
HASH = "RIHS01_" + "5" * 64  # whatever it is: who calls reads it from the token

heard: dict[str, Any] = {"twists": 0, "last": None, "goals": [], "cancelled": 0}
speed = [0.0, 0.0]
state: dict[str, Any] = {"status": 2, "done_at": None}


def on_twist(told: Any) -> None:
    speed[:] = told.linear.x, told.angular.z
    heard["twists"] += 1
    heard["last"] = list(speed)


def on_goal(told: Any) -> Any:
    at = told.pose.pose.position
    heard["goals"].append([told.pose.header.frame_id, at.x, at.y])
    state.update(status=2, done_at=time.monotonic() + (1.0 if at.x < 5 else 60.0))
    kind = "nav2_msgs/srv/msg/NavigateToPose_SendGoal_Response"
    stamp = zenoh_sdk.made(goal, "builtin_interfaces/msg/Time", sec=0, nanosec=0)
    return zenoh_sdk.made(goal, kind, accepted=at.x >= 0, stamp=stamp)


def on_cancel(told: Any) -> Any:
    del told
    heard["cancelled"] += 1
    state.update(status=5, done_at=time.monotonic())
    return zenoh_sdk.made(cancel, "action_msgs/srv/msg/CancelGoal_Response", return_code=0, goals_canceling=[])


odometry = ROS2Publisher("/odom", "nav_msgs/msg/Odometry", zenoh_sdk.definition("nav_msgs/msg/Odometry"), **ROUTER)
scans = ROS2Publisher("/scan", "sensor_msgs/msg/LaserScan", zenoh_sdk.definition("sensor_msgs/msg/LaserScan"), **ROUTER)
twists = ROS2Subscriber(
    "/cmd_vel", "geometry_msgs/msg/Twist", on_twist, zenoh_sdk.definition("geometry_msgs/msg/Twist"), **ROUTER
)
UUID_TEXT = "unique_identifier_msgs/UUID goal_id"
goal = ROS2ServiceServer(
    "/navigate_to_pose/_action/send_goal",
    f"{NAV}_SendGoal",
    on_goal,
    zenoh_sdk.fields(f"{UUID_TEXT}\ngeometry_msgs/PoseStamped pose\nstring behavior_tree", UUID, POSE),
    zenoh_sdk.fields("bool accepted\nbuiltin_interfaces/Time stamp", "builtin_interfaces/msg/Time"),
    type_hash=HASH,
    **ROUTER,
)
result = ROS2ServiceServer(
    "/navigate_to_pose/_action/get_result",
    f"{NAV}_GetResult",
    None,
    zenoh_sdk.fields(UUID_TEXT, UUID),
    "int8 status\nuint16 error_code\nstring error_msg",
    type_hash=HASH,
    mode="queue",
    **ROUTER,
)
cancel = ROS2ServiceServer(
    "/navigate_to_pose/_action/cancel_goal",
    "action_msgs/srv/CancelGoal",
    on_cancel,
    zenoh_sdk.fields("action_msgs/GoalInfo goal_info", INFO),
    zenoh_sdk.fields("int8 return_code\naction_msgs/GoalInfo[] goals_canceling", INFO),
    **ROUTER,
)


def types(kind: str) -> Any:
    return odometry.session_mgr.store.types[kind]


def header(frame: str) -> Any:
    stamp = types("builtin_interfaces/msg/Time")(sec=0, nanosec=0)
    return types("std_msgs/msg/Header")(stamp=stamp, frame_id=frame)


def serve() -> None:
    x = heading = 0.0
    point, turned, vector = (types(f"geometry_msgs/msg/{each}") for each in ("Point", "Quaternion", "Vector3"))
    none = np.zeros(36)
    waiting = []
    began = time.monotonic()
    for turn in range(10**6):
        x, heading = x + speed[0] * 0.05, heading + speed[1] * 0.05
        rotation = turned(x=0.0, y=0.0, z=float(np.sin(heading / 2)), w=float(np.cos(heading / 2)))
        pose = types("geometry_msgs/msg/Pose")(position=point(x=x, y=0.0, z=0.0), orientation=rotation)
        twist = types("geometry_msgs/msg/Twist")(
            linear=vector(x=speed[0], y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=speed[1])
        )
        odometry.publish(
            header=header("odom"),
            child_frame_id="base_link",
            pose=types("geometry_msgs/msg/PoseWithCovariance")(pose=pose, covariance=none),
            twist=types("geometry_msgs/msg/TwistWithCovariance")(twist=twist, covariance=none),
        )
        if turn % 2 == 0:
            ranges = np.full(720, 2.5, np.float32)
            scans.publish(
                header=header("laser"), angle_min=-3.14159, angle_max=3.14159, angle_increment=6.28318 / 720,
                time_increment=0.0, scan_time=0.1, range_min=0.1, range_max=12.0, ranges=ranges,
                intensities=np.zeros(0, np.float32),
            )  # fmt: skip
        with suppress(TimeoutError):
            waiting.append(result.take_request(timeout=0.001)[0])
        if waiting and state["done_at"] is not None and time.monotonic() >= state["done_at"]:
            status = 5 if state["status"] == 5 else 4
            kind = "nav2_msgs/srv/msg/NavigateToPose_GetResult_Response"
            for key in waiting:
                result.send_response(key, zenoh_sdk.made(result, kind, status=status, error_code=0, error_msg=""))
            waiting.clear()
            state["done_at"] = None
        time.sleep(max(0.0, began + 0.05 * (turn + 1) - time.monotonic()))


threading.Thread(target=serve, daemon=True).start()
sys.stdout.write("ready\n")
sys.stdout.flush()
sys.stdin.read()
sys.stdout.write(json.dumps(heard))
sys.stdout.flush()
os._exit(0)  # the session has threads that would go on
