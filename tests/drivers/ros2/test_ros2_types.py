"""Messages by the names of their types: bytes as rosbags makes them, hashes as ROS 2 has them; noise is malformed."""

from random import Random
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from drivers.errors import BadRequest
from drivers.ros2.types import MalformedMessage, types

HASHES = {
    "std_msgs/msg/String": "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "example_interfaces/srv/AddTwoInts": "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a",
}
"""Those of the design document of `rmw_zenoh`: of a message, and of a service."""

GOLDEN = (
    "std_msgs/msg/String", "std_msgs/msg/Bool", "std_msgs/msg/Float64", "std_msgs/msg/Float64MultiArray",
    "std_msgs/msg/Header", "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped", "nav_msgs/msg/Odometry", "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/JointState", "sensor_msgs/msg/BatteryState", "trajectory_msgs/msg/JointTrajectory",
    "action_msgs/msg/GoalStatusArray", "tf2_msgs/msg/TFMessage",
)  # fmt: skip


def some_values(name: str, chance: Random, depth: int = 0) -> dict[str, object]:
    """Return values for the fields of a type, as a mission would give them."""
    types().preload(name)
    store: Any = types()._store

    def value(kind: Any) -> object:
        what, of = kind
        if what == 2:
            return some_values(of, chance, depth + 1)
        if what == 1:
            return {"string": "a word", "bool": True}.get(of[0], chance.randrange(100))
        inner, size = of
        return [value(inner) for _ in range(size if what == 3 else chance.randrange(4))]

    return {word: value(kind) for word, kind in store.fielddefs[name][1]}


def by_rosbags(name: str, values: Any) -> object:
    """Return the same as a message of rosbags, made without us."""
    store: Any = get_typestore(Stores.ROS2_JAZZY)

    def made(kind: Any, given: Any) -> object:
        what, of = kind
        if what == 2:
            return by_rosbags(of, given)
        if what == 1:
            return given
        inner, _ = of
        if inner[0] == 1 and inner[1][0] != "string":
            return np.array(given, dtype={"byte": "uint8", "char": "uint8"}.get(inner[1][0], inner[1][0]))
        return [made(inner, each) for each in given]

    fields = store.fielddefs[name][1]
    return store.types[name](**{word: made(kind, values[word]) for word, kind in fields})


@pytest.mark.parametrize("name", GOLDEN)
def test_encoded_bytes_match_rosbags_and_decode_to_the_same_values(name: str) -> None:
    values = some_values(name, Random(name))  # noqa: S311 - no secret
    golden = bytes(get_typestore(Stores.ROS2_JAZZY).serialize_cdr(by_rosbags(name, values), name, little_endian=True))
    assert types().encode(name, values) == golden
    assert types().encode(name, types().to_plain(types().decode(name, golden))) == golden


@pytest.mark.parametrize("name", HASHES)
def test_type_hashes_match_the_design_document(name: str) -> None:
    assert types().digest(name) == HASHES[name]


def test_nav2_goal_is_encoded_as_id_pose_and_tree() -> None:
    name = "nav2_msgs/action/NavigateToPose_SendGoal_Request"
    pose = {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1.5}, "orientation": {"w": 1}}}
    data = types().encode(name, {"goal_id": {"uuid": list(range(16))}, "goal": {"pose": pose}})
    alone = types().encode("geometry_msgs/msg/PoseStamped", pose)
    assert data[:20] == b"\0\1\0\0" + bytes(range(16))
    assert data[20 : 20 + len(alone) - 4] == alone[4:]
    assert data[16 + len(alone) :] == b"\1\0\0\0\0"
    assert types().decode(name, data).goal.pose.pose.position.x == 1.5


def test_type_without_fields_is_one_byte() -> None:
    assert types().encode("std_srvs/srv/Empty_Request", {}) == b"\0\1\0\0\0"
    assert types().to_plain(types().decode("std_srvs/srv/Empty_Response", b"\0\1\0\0\0")) == {}


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"liner": {}}, "has no field 'liner': its fields are linear, angular"),
        ({"linear": {"x": "fast"}}, "linear.x: needs a number, got 'fast'"),
        ({"linear": 3}, "linear: needs fields, got 3"),
    ],
)
def test_values_of_a_wrong_type_are_refused_with_their_field(values: dict[str, object], told: str) -> None:
    with pytest.raises(BadRequest, match="geometry_msgs/msg/Twist") as caught:
        types().encode("geometry_msgs/msg/Twist", values)
    assert told in str(caught.value)


def test_whole_number_out_of_range_is_refused_with_its_field() -> None:
    with pytest.raises(BadRequest, match=r"LedColor.red: must be from 0 to 255, not 300"):
        types().encode("irobot_create_msgs/msg/LedColor", {"red": 300})


def test_unknown_type_lists_the_known_packages() -> None:
    with pytest.raises(BadRequest, match="'my_msgs/msg/Mine' of ROS 2 is not known") as caught:
        types().encode("my_msgs/msg/Mine", {})
    assert "nav2_msgs" in caught.value.hint
    assert not types().is_known("my_msgs/msg/Mine")


@pytest.mark.parametrize("name", [*GOLDEN, "nav2_msgs/action/NavigateToPose_FeedbackMessage"])
def test_random_bytes_raise_only_malformed_message(name: str) -> None:
    chance = Random(name)  # noqa: S311 - no secret
    good = types().encode(name, some_values(name, chance) if name in GOLDEN else {})
    for _ in range(150):
        noise = bytearray(good[: chance.randrange(len(good) + 1)] + chance.randbytes(chance.randrange(9)))
        for _ in range(chance.randrange(6)):
            if noise:
                noise[chance.randrange(len(noise))] = chance.randrange(256)
        try:
            types().to_plain(types().decode(name, bytes(noise)))
        except MalformedMessage:
            continue
