"""Payloads that were cut, changed and lengthened by chance, told to all that hears ROS 2: none raises anything.

As many as PAYLOADS in the environment says; `make payloads` has a million.
"""

import os
from collections.abc import Callable
from contextlib import suppress
from random import Random
from typing import Any, cast

from drivers.api.driver import DriverContext
from drivers.clock import ManualClock
from drivers.ros2 import wire
from drivers.ros2.action_server import ActionServer
from drivers.ros2.base import TOPIC_TYPES
from drivers.ros2.camera import IMAGES, decode_image
from drivers.ros2.declared import Ros2ArmKeys, Ros2BaseKeys, Ros2JointKeys, Ros2RangeKeys, ZenohKeys
from drivers.ros2.make import arm, base, base_topics, graph, ranger
from drivers.ros2.node import Ros2Node, TopicFaults
from drivers.ros2.ranger import LASER_SCAN
from drivers.ros2.requests import RequestTracker, _Request
from drivers.ros2.types import MalformedMessage, types
from tests.drivers.ros2.test_ros2_types import some_values

PAYLOADS = int(os.environ.get("PAYLOADS", "3000"))

NAVIGATE = "nav2_msgs/action/NavigateToPose"

Take = Callable[[bytes], object]


class Deaf:
    """A node to which nobody listens."""

    faults = TopicFaults("ros2", [], ManualClock())

    def publisher(self, *_: Any) -> "Deaf":
        return self

    def send(self, _: bytes) -> None:
        return None

    def serve(self, *_: Any) -> None:
        return None


def noisy(good: bytes, chance: Random) -> bytes:
    """Cut a payload, change some of its bytes, and lengthen it, each now and then."""
    data = bytearray(good[: chance.randrange(len(good) + 1)] if chance.random() < 0.5 else good)
    for _ in range(chance.randrange(5) if data else 0):
        data[chance.randrange(len(data))] = chance.randrange(256)
    return bytes(data) + (chance.randbytes(chance.randrange(20)) if chance.random() < 0.2 else b"")


def hearers() -> list[tuple[str, Take]]:
    """Return the types that come from outside, each with what takes it."""
    site = DriverContext(ManualClock())
    site = DriverContext(ManualClock(), needed_parts={"ros2": graph(ZenohKeys(domain=0), site)})
    keys = Ros2BaseKeys(battery="battery", hazards="hazards", dock="dock", sensors="sensors")
    parts: list[tuple[str, int, Any]] = [
        (TOPIC_TYPES[word][0], number, base(keys, site))
        for number, word in enumerate(base_topics(keys))
        if word != "cmd_vel"
    ]
    joints = arm(Ros2ArmKeys(joints={"elbow": Ros2JointKeys(joint="a word")}), site)
    parts += [(LASER_SCAN, 0, ranger(Ros2RangeKeys(), site)), ("sensor_msgs/msg/JointState", 0, joints)]
    found: list[tuple[str, Take]] = [
        (kind, lambda data, number=number, part=part: part.on_data(wire.frame(number, data)))  # type: ignore[misc]
        for kind, number, part in parts
    ]

    def seen(kind: str) -> Take:
        def take(data: bytes) -> None:
            with suppress(MalformedMessage, ValueError):
                decode_image(kind, data)

        return take

    found += [(kind, seen(kind)) for kind in IMAGES]
    requests = RequestTracker(lambda: cast(Ros2Node, Deaf()), site.clock, lambda: None)

    def new(*, goal: bool) -> _Request:
        kind = NAVIGATE if goal else "std_srvs/srv/Trigger"
        return _Request("/x", kind, wire.Entity("SS", 0, "a", "0", "1", "nav2", "", "/x", kind), goal=goal)

    found += [
        (f"{NAVIGATE}_FeedbackMessage", lambda data: requests._on_feedback(f"{NAVIGATE}_FeedbackMessage", data)),
        (f"{NAVIGATE}_GetResult_Response", lambda data: requests._on_result(new(goal=True), data)),
        ("std_srvs/srv/Trigger_Response", lambda data: requests._on_response(new(goal=False), data)),
    ]
    server = ActionServer(cast(Ros2Node, Deaf()), "/x", NAVIGATE, lambda _: False, lambda _: None)
    found += [
        (f"{NAVIGATE}_SendGoal_Request", lambda data: server._on_goal_request(data, lambda _: None)),
        (f"{NAVIGATE}_GetResult_Request", lambda data: server._on_result_request(data, lambda _: None)),
        ("action_msgs/srv/CancelGoal_Request", lambda data: server._on_cancel_request(data, lambda _: None)),
    ]
    return found


def test_random_payloads_never_raise() -> None:
    chance, known = Random(22), hearers()  # noqa: S311 - no secret
    good = [types().encode(kind, some_values(kind, chance)) for kind, _ in known]
    for number in range(PAYLOADS):
        which = number % len(known)
        known[which][1](noisy(good[which], chance))
