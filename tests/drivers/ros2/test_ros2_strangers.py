"""What robots say that are not as ours: forms, figures, names and clocks of the many ROS 2 that there are."""

import struct
from collections.abc import Iterator
from math import cos, inf, nan, sin, tau
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.api import Health, Sides
from drivers.api.driver import DriverContext
from drivers.clock import ManualClock
from drivers.ros2 import base as create3
from drivers.ros2 import wire
from drivers.ros2.base import TOPIC_TYPES
from drivers.ros2.camera import IMAGES, TopicFeed, decode_image
from drivers.ros2.declared import Ros2ArmKeys, Ros2JointKeys, Ros2RangeKeys, ZenohKeys
from drivers.ros2.joint_topics import JOINT_STATE
from drivers.ros2.make import arm as make_arm
from drivers.ros2.make import graph as make_graph
from drivers.ros2.make import ranger as make_ranger
from drivers.ros2.publisher import MessageFilter
from drivers.ros2.ranger import LASER_SCAN, Ros2Ranger
from drivers.ros2.types import types
from drivers.ros2.wire import Attachment
from tests.contract.test_ros2_base_contract import TOPICS, Topics

GID = bytes(range(16))


# --- attachments ----------------------------------------------------------------------------------------------------


def test_attachment_with_named_fields_is_parsed_and_answered_in_kind() -> None:
    named = b"".join(
        bytes([len(word)]) + word + data
        for word, data in (
            (b"sequence_number", struct.pack("<q", 7)),
            (b"source_timestamp", struct.pack("<q", 10**18)),
            (b"source_gid", bytes([16]) + GID),
        )
    )
    told = wire.parse_attachment(named)
    assert told is not None
    assert (told.number, told.sent_at, told.gid) == (7, 10**18, GID)
    assert told.pack() == named


@pytest.mark.parametrize("length", [1, 12, 24])
def test_gid_of_another_length_is_accepted(length: int) -> None:
    told = Attachment(7, 10**18, bytes(length))
    assert wire.parse_attachment(told.pack()) == told


def test_messages_without_a_time_are_accepted_by_number() -> None:
    sieve = MessageFilter()
    assert all(sieve.accepts(Attachment(number, 0, GID), number / 10) for number in range(100))


def test_clock_offsets_and_jumps_of_hours_do_not_make_messages_late() -> None:
    sieve = MessageFilter()
    passed = []
    for number in range(100):
        ahead = 7200 if number >= 50 else -7200
        passed.append(sieve.accepts(Attachment(number, round((number / 10 + ahead) * 1e9), GID), number / 10))
    assert all(passed)


# --- range finders --------------------------------------------------------------------------------------------------


@pytest.fixture
def ranger() -> Iterator[Ros2Ranger]:
    site = DriverContext(ManualClock())
    found: Ros2Ranger = make_ranger(
        Ros2RangeKeys(), DriverContext(site.clock, needed_parts={"ros2": make_graph(ZenohKeys(domain=0), site)})
    )
    yield found
    found.close()


def scanned(ranger: Ros2Ranger, **given: object) -> Any:
    values = {
        "angle_min": -0.1, "angle_max": 0.1, "angle_increment": 0.1, "range_min": 0.1, "range_max": 10.0,
        "ranges": [1.0, 2.0, 3.0],
    }  # fmt: skip
    ranger.on_data(wire.frame(0, types().encode(LASER_SCAN, values | given)))
    return ranger.scan().value


def test_scan_with_infinite_maximum_range_is_accepted(ranger: Ros2Ranger) -> None:
    scan = scanned(ranger, range_max=inf, ranges=[1.0, inf, 3.0])
    assert scan is not None
    assert np.isfinite(scan.most)
    assert scan.ranges[0] == 1.0
    assert np.isnan(scan.ranges[1])


def test_invalid_ranges_become_nan_and_a_clockwise_scan_is_reversed(ranger: Ros2Ranger) -> None:
    scan = scanned(ranger, angle_min=0.1, angle_increment=-0.1, ranges=[-1.0, nan, 3.0])
    assert (scan.start, scan.step) == (pytest.approx(-0.1), pytest.approx(0.1))
    assert scan.ranges[0] == 3.0
    assert np.isnan(scan.ranges[1:]).all()
    assert np.isnan(scanned(ranger, ranges=[0.0, inf, -inf]).ranges).all()


def test_scan_with_invalid_angles_is_malformed(ranger: Ros2Ranger) -> None:
    several: tuple[dict[str, object], ...] = (
        {"angle_increment": nan}, {"angle_increment": 0.0}, {"angle_min": inf}, {"ranges": []},
    )  # fmt: skip
    for wrong in several:
        assert scanned(ranger, **wrong) is None
    assert ranger.health().counters["malformed"] == 4


@pytest.mark.parametrize(
    "given",
    [
        {"range_max": 0.0},
        {"range_max": nan},
        {"range_max": 0.0, "range_min": 0.0},
        {"range_min": nan},
        {"scan_time": nan},
        {"angle_max": 0.0, "angle_min": 0.0, "angle_increment": 2.0},
        {"angle_min": 6.0, "angle_max": 6.2 - tau},
        {"angle_max": 0.2},
        {"angle_max": nan},
        {"intensities": [1.0, 2.0, 3.0]},
    ],
)
def test_scan_with_missing_fields_is_used_if_unambiguous(ranger: Ros2Ranger, given: dict[str, object]) -> None:
    scan = scanned(ranger, **given)
    assert scan is not None
    assert scan.ranges.tolist() == [1.0, 2.0, 3.0]
    assert (scan.least, scan.most) >= (0.0, 10.0)
    assert ranger.health().counters["malformed"] == 0


REFUSED: tuple[tuple[dict[str, object], str], ...] = (
    ({"range_max": 0.05}, "its range_min is 0.1 and its range_max 0.05 m"),
    ({"range_max": -1.0}, "its range_max -1 m"),
    ({"range_max": -inf}, "its range_max -inf m"),
    ({"range_min": inf}, "its range_min is inf"),
    ({"angle_increment": 0.0}, "its angle_increment is 0"),
    ({"angle_increment": nan}, "its angle_increment is nan"),
    ({"angle_increment": -0.1}, "its angles go from -0.1 to 0.1 rad, which is not 3 ranges by -0.1 rad"),
    ({"angle_max": -0.1 + 2, "angle_increment": 0.01}, "which is not 3 ranges by 0.01 rad"),
    ({"angle_min": -180.0, "angle_max": 180.0, "angle_increment": 120.0}, "more than a turn: is it in degrees?"),
    ({"angle_min": nan}, "its angle_min is nan"),
    ({"ranges": [], "intensities": [1.0, 2.0]}, "it has no ranges, but 2 intensities"),
    ({"ranges": []}, "it has no ranges"),
    ({"ranges": [1.0] * 10_001, "angle_increment": 1e-5}, "it has 10001 ranges, and 10000 are the most"),
    ({"ranges": [0.0, 0.0, 0.0]}, "all its 3 ranges are 0: nothing was measured"),
    ({"ranges": [0.0, nan, nan]}, "all its 3 ranges are 0 or not a number"),
    ({"ranges": [0.01, 0.02, -inf]}, "all its 3 ranges are below its range_min of 0.1 m"),
    ({"ranges": [800.0, 950.0, 1200.0]}, "above its range_max of 10 m (800 to 1200): are they in millimetres?"),
    ({"ranges": [1.0] * 40}, "which is not 40 ranges by 0.1 rad"),
)


@pytest.mark.parametrize(("given", "why"), REFUSED)
def test_ambiguous_scan_is_refused_with_its_reason(ranger: Ros2Ranger, given: dict[str, object], why: str) -> None:
    ranger._kind = LASER_SCAN
    ranger._link.health = lambda: Health(True)  # type: ignore[method-assign]
    assert scanned(ranger, **given) is None
    health = ranger.health()
    assert (health.online, health.counters["malformed"]) == (False, 1)
    assert health.detail.startswith("range: /scan: malformed message: ")
    assert why in health.detail
    assert LASER_SCAN in health.detail


def test_clockwise_scan_keeps_left_on_the_left(ranger: Ros2Ranger) -> None:
    scan = scanned(ranger, angle_min=1.6, angle_max=-1.6, angle_increment=-1.6, ranges=[1.0, 2.0, 3.0])
    assert dict(zip(scan.bearings().round(3).tolist(), scan.ranges.tolist(), strict=True)) == {-1.6: 3, 0: 2, 1.6: 1}


@pytest.mark.parametrize("blank", [[inf, inf, inf], [10.5, 10.5, 10.5], [0.0, inf, -inf]])
def test_scan_with_nothing_near_is_accepted(ranger: Ros2Ranger, blank: list[float]) -> None:
    assert np.isnan(scanned(ranger, ranges=blank).ranges).all()


# --- bases ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def base() -> Iterator[Topics]:
    rig = Topics()
    rig.start()
    yield rig
    rig.close()


def told(base: Topics, word: str, **values: object) -> None:
    """Let the robot say something besides."""
    base.wire.take(wire.frame(list(TOPICS).index(word), types().encode(TOPIC_TYPES[word][0], values)))
    base.wait(0.05)


def odometry(base: Topics, x: float, y: float, turned: dict[str, float], frame: str = "odom") -> None:
    """Let it say where it is, and nothing else from now on."""
    base.robot.is_stalled = True
    header = {"frame_id": frame}
    told(base, "odom", header=header, pose={"pose": {"position": {"x": x, "y": y}, "orientation": turned}})


def about_z(angle: float, length: float = 1.0) -> dict[str, float]:
    return {"z": length * sin(angle / 2), "w": length * cos(angle / 2)}


def test_orientation_of_any_length_is_normalised(base: Topics) -> None:
    origin = base.robot.origin
    odometry(base, origin.x, origin.y, about_z(origin.heading + 0.3, 2.0))
    assert base.state().pose.heading == pytest.approx(0.3, abs=1e-6)


def test_unset_orientation_is_malformed(base: Topics) -> None:
    before, counted = base.state().pose, base.device.health().counters["malformed"]
    odometry(base, 3.0, -2.0, {"w": 0.0})
    odometry(base, 3.0, -2.0, {"w": nan})
    assert base.state().pose == before
    assert base.device.health().counters["malformed"] == counted + 2


def test_reset_of_the_odometry_heading_does_not_turn_the_base(base: Topics) -> None:
    origin, before = base.robot.origin, base.state().pose
    odometry(base, origin.x, origin.y, about_z(origin.heading + 2.0))
    assert base.state().pose.heading == pytest.approx(before.heading, abs=1e-6)


def test_odometry_frame_has_no_leading_slash(base: Topics) -> None:
    frames: list[str] = []
    base.device.protocol._on_origin = lambda _, frame: frames.append(frame)  # type: ignore[attr-defined]
    odometry(base, 40.0, 7.0, about_z(0.0), "/tb4/odom")
    odometry(base, 80.0, 7.0, about_z(0.0), "tb4/odom")
    assert frames == ["tb4/odom", "tb4/odom"]


@pytest.mark.parametrize(
    ("shares", "percent"),
    [
        ((0.5,), 50.0),
        ((55.0,), 55.0),
        ((1.0,), 100.0),
        ((3.0, 1.0, 0.8), 0.8),  # of hundred, as it has said before
        ((nan,), 100.0),
        ((inf,), 100.0),
        ((-1.0,), 100.0),  # what some say who do not measure it
    ],
)
def test_battery_percentage_may_be_a_share_percent_or_unmeasured(
    base: Topics, shares: tuple[float, ...], percent: float
) -> None:
    for share in shares:
        told(base, "battery", percentage=share, voltage=14.0, present=True)
        base.wait(0.1)
    assert base.state().battery_percent == pytest.approx(percent, abs=1e-4)


def test_absent_battery_is_not_empty(base: Topics) -> None:
    told(base, "battery", percentage=0.0, voltage=nan, present=False)
    base.wait(0.1)
    assert (base.state().battery_percent, base.state().battery_voltage) == (100.0, 0.0)


def detection(kind: int, frame: str) -> Any:
    return SimpleNamespace(type=kind, header=SimpleNamespace(frame_id=frame))


@pytest.mark.parametrize("namespace", ["", "left_robot/", "centre/right/"])
def test_contact_side_comes_from_the_frame_not_the_namespace(namespace: str) -> None:
    bumper = create3.parse_hazards([detection(create3.BUMP, f"{namespace}bump_right")]).bumper
    assert (bumper.left, bumper.centre, bumper.right) == (False, False, True)


@pytest.mark.parametrize(
    ("kind", "frame", "name"),
    [
        (0, "base_link", "backup limit"),
        (0, "left_robot/base_link", "backup limit"),
        (3, "base_link", "stall"),
        (3, "left_robot/wheel_right", "stall right"),
        (5, "ir_intensity_left", "object near left"),
        (6, "base_link", "hazard of type 6 (base_link)"),
        (255, "", "hazard of type 255"),
    ],
)
def test_other_hazards_are_named_and_unknown_types_are_kept(kind: int, frame: str, name: str) -> None:
    report = create3.parse_hazards([detection(kind, frame), detection(create3.BUMP, "bump_left")])
    assert report.others == {name}
    assert report.bumper == Sides(left=True)


# --- joints ---------------------------------------------------------------------------------------------------------


def test_joints_without_measured_velocities_are_reported() -> None:
    site = DriverContext(ManualClock())
    keys = Ros2ArmKeys(joints={"elbow": Ros2JointKeys(joint="arm_2"), "wrist": Ros2JointKeys(joint="arm_3")})
    arm = make_arm(keys, DriverContext(site.clock, needed_parts={"ros2": make_graph(ZenohKeys(domain=0), site)}))
    for position in (0.1, 0.2):
        values = {"name": ["arm_2", "arm_3"], "position": [position, nan], "velocity": [nan, nan], "effort": [nan, nan]}
        arm.on_data(wire.frame(0, types().encode(JOINT_STATE, values)))
        site.clock.advance(0.1)  # type: ignore[attr-defined]
    elbow, wrist = (arm.states()[name].value for name in ("elbow", "wrist"))
    assert elbow is not None
    assert elbow.position == pytest.approx(0.2)
    assert elbow.velocity == pytest.approx(1.0)
    assert wrist is None
    arm.close()


# --- cameras --------------------------------------------------------------------------------------------------------


def raw(encoding: str, rows: np.ndarray[Any, Any], width: int, **given: object) -> Any:
    values = {
        "height": len(rows),
        "width": width,
        "encoding": encoding,
        "step": rows.strides[0],
        "data": rows.tobytes(),
    }
    return decode_image(IMAGES[0], types().encode(IMAGES[0], values | given))


@pytest.mark.parametrize(
    ("encoding", "first"),
    [("bayer_rggb8", (0, 0)), ("bayer_bggr8", (1, 1)), ("bayer_gbrg8", (1, 0)), ("bayer_grbg8", (0, 1))],
)
def test_each_bayer_pattern_keeps_red(encoding: str, first: tuple[int, int]) -> None:
    rows = np.zeros((8, 8), np.uint8)
    rows[first[0] :: 2, first[1] :: 2] = 200
    blue, green, red = raw(encoding, rows, 8)[4, 4]
    assert red > 150
    assert max(blue, green) < 50


@pytest.mark.parametrize("encoding", ["yuv422", "uyvy", "UYVY"])
def test_yuv422_is_decoded_as_uyvy(encoding: str) -> None:
    rows = np.tile(np.array([128, 220, 128, 220], np.uint8), (4, 3))
    assert np.ptp(raw(encoding, rows, 6)) <= 2
    assert raw(encoding, rows, 6).mean() > 200


def test_nv21_picture_is_decoded() -> None:
    rows = np.full((6, 4), 128, np.uint8)
    rows[:4] = 220
    assert raw("nv21", rows, 4, height=4).shape == (4, 4, 3)
    assert raw("nv21", rows, 4, height=4).mean() > 200


@pytest.mark.parametrize(("order", "big"), [("<u2", 0), (">u2", 1)])
@pytest.mark.parametrize("encoding", ["mono16", "bgr16", "rgb16", "bayer_rggb16"])
def test_16_bit_pictures_are_scaled_to_8_bits_in_both_byte_orders(encoding: str, order: str, big: int) -> None:
    rows = np.full((4, 12 if encoding in {"bgr16", "rgb16"} else 4), 200 * 256 + 7, order)
    found = raw(encoding, rows, 4, is_bigendian=big)
    assert found.shape == (4, 4, 3)
    assert (found == 200).all()


def test_depth_image_is_refused_and_padded_rows_are_accepted() -> None:
    with pytest.raises(ValueError, match="16UC1"):
        raw("16UC1", np.zeros((4, 4), "<u2"), 4)
    padded = np.zeros((4, 16), np.uint8)
    padded[:, :12] = 90
    assert (raw("bgr8", padded, 4) == 90).all()


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_truncated_compressed_picture_is_refused(suffix: str) -> None:
    good = cv2.imencode(suffix, np.random.default_rng(1).integers(0, 255, (60, 80, 3), np.uint8))[1].tobytes()

    def shown(data: bytes) -> Any:
        return decode_image(
            IMAGES[1], types().encode(IMAGES[1], {"format": f"bgr8; {suffix} compressed", "data": data})
        )

    assert shown(good).shape == (60, 80, 3)
    assert shown(good + bytes(7)).shape == (60, 80, 3)
    for data in (good[: len(good) // 2], good[:-40], b"", b"\xff\xd8", good[:30]):
        with pytest.raises(ValueError, match="no picture"):
            shown(data)


def test_camera_names_an_unsupported_encoding() -> None:
    feed = TopicFeed(lambda _: None, "/depth", ManualClock())  # type: ignore[arg-type,return-value]
    feed._port = Sent(types().encode(IMAGES[0], {"height": 1, "width": 1, "encoding": "32FC1", "step": 4}))  # type: ignore[assignment]
    feed._kind = IMAGES[0]
    assert feed.grab(lambda: 0) is None
    assert "'32FC1' is not understood" in feed.hint


class Sent:
    """A port on which one message comes, and then nothing more."""

    def __init__(self, payload: bytes) -> None:
        self._waiting = [wire.frame(0, payload)]

    def read_available(self, _: float) -> bytes:
        if not self._waiting:
            raise OSError("the session has gone")
        return self._waiting.pop()
