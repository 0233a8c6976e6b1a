"""Messages that cannot be used: each part reports the topic, the type that it expected, and what came."""

import struct
from collections.abc import Callable
from math import nan
from typing import Any

import pytest

from drivers.api import DeviceStatus
from drivers.api.driver import DriverContext
from drivers.clock import ManualClock
from drivers.ros2 import wire
from drivers.ros2.base import ODOMETRY, TOPIC_TYPES
from drivers.ros2.declared import Ros2ArmKeys, Ros2BaseKeys, Ros2JointKeys, Ros2RangeKeys, Ros2VoiceKeys, ZenohKeys
from drivers.ros2.joint_topics import JOINT_STATE
from drivers.ros2.make import arm, base, graph, ranger, voice
from drivers.ros2.node import MALFORMED_LIFETIME, MAX_TOPICS, REPORT_INTERVAL, TopicFaults
from drivers.ros2.ranger import LASER_SCAN
from drivers.ros2.types import MalformedMessage, types

GOOD: dict[str, bytes] = {
    ODOMETRY: types().encode(ODOMETRY, {"header": {"frame_id": "odom"}, "pose": {"pose": {"orientation": {"w": 1.0}}}}),
    LASER_SCAN: types().encode(LASER_SCAN, {"angle_increment": 0.1, "range_max": 9.0, "ranges": [1.0, 2.0]}),
    JOINT_STATE: types().encode(JOINT_STATE, {"name": ["elbow"], "position": [0.1]}),
}
TEXT = types().encode("std_msgs/msg/String", {"data": "what is this doing here, and why is it so long?"})


def big_endian(kind: str, values: dict[str, object]) -> bytes:
    made = types()._make_message(kind, values, kind)
    return bytes(types()._store.serialize_cdr(made, kind, little_endian=False))


def lengthened(good: bytes, at: bytes) -> bytes:
    """Say that the list or text behind ``at`` has 2^31 elements."""
    place = good.index(at)
    return good[: place - 4] + struct.pack("<I", 2**31) + good[place:]


SPOILT: dict[str, tuple[Callable[[str], bytes], str]] = {
    "nothing": (lambda _: b"", "got 0 bytes: too short for a CDR header"),
    "a header alone": (lambda _: b"\0\1\0\0", "got 4 bytes that begin 00 01 00 00: "),
    "cut off": (lambda kind: GOOD[kind][:-3], "bytes that begin 00 01 00 00"),
    "without its header": (lambda kind: b"\x41\x42" + GOOD[kind][4:], "it has no CDR header"),
    "XCDR2": (lambda kind: b"\0\7" + GOOD[kind][2:], "its header says XCDR2, not CDR"),
    "a delimited XCDR2": (lambda kind: b"\0\x09" + GOOD[kind][2:], "its header says XCDR2 (delimited), not CDR"),
    "a parameter list": (lambda kind: b"\0\3" + GOOD[kind][2:], "its header says a parameter list (PL_CDR)"),
    "another type": (lambda _: TEXT, f"got {len(TEXT)} bytes"),
    "too long": (lambda kind: GOOD[kind] + bytes(400), "CDR message size mismatch"),
    "the wrong byte order": (lambda kind: b"\0\0" + GOOD[kind][2:], "bytes that begin 00 00 00 00"),
}


class Part:
    """A part of a robot whose topics are sent to by hand; ``told`` is what it reports."""

    def __init__(self, name: str) -> None:
        self.told: list[DeviceStatus] = []
        self.clock = ManualClock()
        site = DriverContext(self.clock, report=self.told.append)
        site = DriverContext(
            self.clock, report=self.told.append, needed_parts={"ros2": graph(ZenohKeys(domain=0), site)}, part=name
        )
        self.kind = {"base": ODOMETRY, "range": LASER_SCAN, "arm": JOINT_STATE}.get(name, "")
        self.number = list(TOPIC_TYPES).index("odom") if name == "base" else 0
        self.device: Any
        match name:
            case "base":
                self.device = base(Ros2BaseKeys(), site)
            case "range":
                self.device = ranger(Ros2RangeKeys(), site)
            case "voice":
                self.device = voice(Ros2VoiceKeys(), site)
            case _:
                joint = Ros2JointKeys(limits=(-1.0, 1.0))
                self.device = arm(Ros2ArmKeys(command="c", joints={"elbow": joint}), site)

    def hear(self, payload: bytes) -> None:
        self.device.on_data(wire.frame(self.number, payload))

    @property
    def topics(self) -> Any:
        """What reads the messages: of a base, its protocol."""
        return getattr(self.device, "protocol", self.device)

    @property
    def faults(self) -> list[str]:
        return [each.message for each in self.told if each.kind == "fault"]


@pytest.mark.parametrize("spoilt", SPOILT)
@pytest.mark.parametrize("name", ["base", "range", "arm"])
def test_malformed_message_is_reported_with_expected_and_actual_type(name: str, spoilt: str) -> None:
    part = Part(name)
    make, why = SPOILT[spoilt]
    part.hear(make(part.kind))
    (fault,) = part.faults
    topic = {"base": "/odom", "range": "/scan", "arm": "/joint_states"}[name]
    assert fault.startswith(f"{topic}: malformed message: expected {part.kind}, got ")
    assert why in fault
    assert topic in part.told[0].hint
    assert part.device.health().counters["malformed"] == 1


@pytest.mark.parametrize("field", ["position x", "orientation z", "linear x"])
def test_odometry_with_nan_names_its_field(field: str) -> None:
    part = Part("base")
    which, axis = field.split()
    pose: dict[str, Any] = {"orientation": {"w": 1.0}, "position": {}}
    values: dict[str, Any] = {"pose": {"pose": pose}, "twist": {"twist": {"linear": {}}}}
    (values["twist"]["twist"] if which == "linear" else pose)[which][axis] = nan
    part.hear(types().encode(ODOMETRY, values))
    assert part.faults == [f"/odom: malformed message: its {field} is nan, in {ODOMETRY}"]


def test_list_longer_than_its_message_is_malformed() -> None:
    for kind, at in ((LASER_SCAN, struct.pack("<ff", 1.0, 2.0)), (JOINT_STATE, struct.pack("<I", 6) + b"elbow")):
        with pytest.raises(MalformedMessage, match=f"expected {kind}"):
            types().decode(kind, lengthened(GOOD[kind], at))
    with pytest.raises(
        MalformedMessage, match="got 47 bytes that begin 00 01 00 00 30 00 00 00: Invalid string length 48"
    ):
        types().decode("std_msgs/msg/String", TEXT[:-9])


def test_big_endian_message_is_decoded() -> None:
    part = Part("range")
    part.hear(big_endian(LASER_SCAN, {"angle_increment": 0.1, "range_max": 9.0, "ranges": [1.0, 2.0]}))
    assert part.device.scan().value.ranges.tolist() == [1.0, 2.0]
    assert part.faults == []


def test_repeated_malformed_messages_are_reported_seldom() -> None:
    part = Part("range")
    for _ in range(200):
        part.hear(TEXT)
        part.clock.advance(0.1)
    assert len(part.faults) == 2
    assert part.device.health().counters["malformed"] == 200


@pytest.mark.parametrize(("name", "number", "verb"), [("base", 1, "sends"), ("base", 0, "listens for"),
                                                      ("range", 0, "sends"), ("voice", 0, "listens for")])  # fmt: skip
def test_type_mismatch_is_reported_while_it_lasts(name: str, number: int, verb: str) -> None:
    part = Part(name)
    why = f"expected this, but a node {verb} sensor_msgs/msg/Imu"
    part.device.on_data(wire.mismatch_frame(number, why))
    (fault,) = part.faults
    assert fault.endswith(f": {why}")
    part.clock.advance(REPORT_INTERVAL + MALFORMED_LIFETIME)
    assert part.topics._faults.fault(number) == fault
    part.device.on_data(wire.mismatch_frame(number, ""))
    assert part.topics._faults.fault(number) == ""


def test_part_without_valid_messages_gives_the_reason() -> None:
    part = Part("base")
    part.topics._remote_types |= {"odom": (ODOMETRY,), "cmd_vel": ("geometry_msgs/msg/Twist",)}
    part.hear(TEXT)
    what, hint = part.topics.offline_reason(part.clock.now(), "", 0, silent=False)
    assert what.startswith(f"base: /odom: malformed message: expected {ODOMETRY}, got")
    assert "mission ros2 echo /odom" in hint
    part.clock.advance(MALFORMED_LIFETIME + 0.1)
    assert part.topics.offline_reason(part.clock.now(), "", 0, silent=False)[0] == "base: /odom: no odometry received"


def test_joint_with_nan_position_is_named() -> None:
    part = Part("arm")
    part.device._remote_types |= {0: JOINT_STATE, 1: "std_msgs/msg/Float64MultiArray"}
    part.hear(types().encode(JOINT_STATE, {"name": ["elbow"], "position": [nan]}))
    assert part.device._offline_reason(part.clock.now())[0].endswith("no states of elbow; not a number: elbow")


def test_topic_faults_have_bounded_memory() -> None:
    faults = TopicFaults("ros2", [], ManualClock())
    for number in range(3 * MAX_TOPICS):
        faults.add_for_topic(f"/{number}", "x")
    assert len(faults._malformed) == MAX_TOPICS
