"""The head: its arithmetic, its conversation with the board on a hand-cranked clock, and the whole in real time."""

import math
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from math import radians
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.api import DeviceStatus, Head, HeadPose, Health, Quality
from drivers.arduino import wire
from drivers.arduino.board import IDLE_POLL_INTERVAL, ArduinoBoard
from drivers.arduino.driver import ArduinoHead
from drivers.arduino.virtual import VirtualRodney
from drivers.clock import ManualClock
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.head.angle_store import ServoAngleStore
from drivers.head.axis import ENCODER_SKETCH_STARTS, ServoAxis
from drivers.transport.link import LinkHandler, SerialLink
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal
from tests.waiting import wait_until

PAN = ServoAxis(0, radians(-80), radians(80), start=90)
TILT = ServoAxis(1, radians(-60), radians(20), flip=True, start=120)


def servo(index: int, angle: int) -> bytes:
    return wire.RosserialFrame(100, wire.ServoAngle(index, angle).pack()).pack()


def servos(data: bytes) -> list[tuple[int, int]]:
    """Return what was sent to servos: index and degrees."""
    frames = [frame for frame in wire.RosserialFrameFinder().feed(data) if frame.topic == 100]
    return [(angle.index, angle.angle) for angle in map(wire.ServoAngle.unpack, (frame.data for frame in frames))]


def degrees(head: ArduinoHead) -> tuple[float, float]:
    """Return the head's pan and tilt in degrees."""
    pose = head.pose().value
    assert pose is not None
    return math.degrees(pose.pan), math.degrees(pose.tilt)


# --- the axis and the ramp --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("angle", "flip", "trim", "sent"),
    [
        (0, False, 0, 90),
        (30, False, 0, 120),
        (30, True, 0, 60),
        (-30, True, 0, 120),
        (30, False, 10, 130),
        (30, True, 10, 70),
        (30.4, False, 0, 120),
        (30.6, False, 0, 121),
        (90, False, 0, 180),
        (120, False, 0, 180),
        (-120, False, 0, 0),
        (120, True, 0, 0),
        (60, False, 45, 180),
        (-60, False, -45, 0),
    ],
)
def test_angle_is_rounded_to_degrees_of_the_sketch(angle: float, flip: bool, trim: float, sent: int) -> None:
    axis = ServoAxis(0, radians(-180), radians(180), flip=flip, trim=radians(trim))
    assert axis.to_degrees(radians(angle)) == sent


# Both devices of the Rodney project's pan/tilt node: servo, joint, limits in radians as its parameters have them.
RODNEY = {
    "index0 pan": ServoAxis(0, -math.pi / 2, math.pi / 2),
    "index0 tilt": ServoAxis(1, -1.39626, 0.349066, flip=True),
    "index1 pan": ServoAxis(2, -math.pi / 2, math.pi / 2),
    "index1 tilt": ServoAxis(3, -math.pi / 2, math.pi / 2),
}


@pytest.mark.parametrize(
    ("name", "angle", "trim", "sent"),
    [
        ("index0 pan", 0.0, 0, (0, 90)),
        ("index0 pan", 0.872665, 0, (0, 140)),  # view_step of its head scan
        ("index0 pan", -0.872665, 0, (0, 40)),
        ("index0 pan", math.pi / 2, 0, (0, 180)),
        ("index0 pan", 2.0, 0, (0, 180)),
        ("index0 pan", 0.0, 45, (0, 135)),
        ("index0 pan", math.pi / 2, 10, (0, 180)),
        ("index0 tilt", 0.0, 0, (1, 90)),
        ("index0 tilt", -0.523599, 0, (1, 120)),  # user_position: looks up, and the sketch starts there
        ("index0 tilt", 0.349066, 0, (1, 70)),
        ("index0 tilt", 0.6, 0, (1, 70)),  # clipped at its max
        ("index0 tilt", -1.39626, 0, (1, 170)),
        ("index0 tilt", -1.5, 0, (1, 170)),  # clipped at its min
        ("index0 tilt", -0.523599, 5, (1, 125)),
        ("index0 tilt", -0.523599, -5, (1, 115)),
        ("index0 tilt", -1.39626, 20, (1, 180)),
        ("index1 pan", 0.436332, 0, (2, 115)),
        ("index1 pan", 0.436332, -45, (2, 70)),
        ("index1 tilt", 0.349066, 0, (3, 110)),
        ("index1 tilt", -2.0, 0, (3, 0)),
    ],
)
def test_trims_flips_and_limits_match_the_node_of_rodney(
    name: str, angle: float, trim: float, sent: tuple[int, int]
) -> None:
    axis = RODNEY[name].with_trim(radians(trim))
    held = min(max(angle, axis.range[0]), axis.range[1])
    assert (axis.index, axis.to_degrees(held)) == sent
    if trim == 0:
        clipped = min(max(angle, axis.lower), axis.upper)
        turned = (-clipped if axis.flip else clipped) * 180 / math.pi + 90
        assert axis.to_degrees(held) == pytest.approx(turned, abs=0.5)


@given(st.integers(0, 180), st.booleans(), st.floats(-radians(45), radians(45)))
def test_sent_degree_converts_back_to_the_same_degree(sent: int, flip: bool, trim: float) -> None:
    axis = ServoAxis(3, -math.pi, math.pi, flip=flip, trim=trim)
    assert axis.to_degrees(axis.to_radians(sent)) == sent
    assert axis.range[0] - 1e-9 <= axis.to_radians(sent) <= axis.range[1] + 1e-9


def test_axis_range_is_the_reachable_part_of_its_limits() -> None:
    assert PAN.range == (PAN.lower, PAN.upper)
    assert ServoAxis(0, -3.0, 3.0).range == pytest.approx((radians(-90), radians(90)))
    assert ServoAxis(0, -3.0, 0.5, trim=radians(10)).range == pytest.approx((radians(-100), 0.5))
    assert ServoAxis(0, -3.0, 3.0, flip=True, trim=radians(10)).range == pytest.approx((radians(-80), radians(100)))


@pytest.mark.parametrize(
    ("index", "lower", "upper", "trim", "complaint"),
    [
        (256, -1.0, 1.0, 0.0, "index 256"),
        (0, 1.0, -1.0, 0.0, "lower limit 1.0"),
        (0, math.nan, 1.0, 0.0, "lower limit nan"),
        (0, -1.0, 1.0, 0.8, "a trim of 45.8 deg"),
        (0, 2.0, 3.0, 0.0, "within its reach"),
    ],
)
def test_impossible_axis_gives_the_reason(index: int, lower: float, upper: float, trim: float, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        ServoAxis(index, lower, upper, trim=trim)


def test_axis_knows_the_start_angle_of_the_sketch() -> None:
    assert [ServoAxis(index, -1.0, 1.0).start_degrees for index in range(5)] == [90, 120, 90, 90, 90]
    assert ServoAxis(1, -1.0, 1.0, start=45).start_degrees == 45
    with pytest.raises(ValueError, match="a start of 181 degrees"):
        ServoAxis(0, -1.0, 1.0, start=181)


# --- the conversation, on a clock cranked by hand ---------------------------------------------------------------------


class Wire(SerialLink):
    """A link without a port: a virtual board hangs on it, and the test turns the crank."""

    def __init__(self, device: VirtualRodney, clock: ManualClock) -> None:
        super().__init__("head", "/dev/nano", 57600)
        self.device = device
        self.clock = clock
        self.sent = b""
        self.probes = 0
        self.plugged = False
        self.noise = b""
        self.deaf_until = self.late_until = 0.0
        self._pending = b""
        self.served = 0
        self._dozes_until = 0.0

    @property
    def online(self) -> bool:
        return self.plugged

    def health(self) -> Health:
        return Health(self.plugged, "" if self.plugged else "head: /dev/nano: no such device")

    def open(self, handler: LinkHandler) -> None:
        self.talker = handler

    def close(self) -> None:
        if self.plugged:
            self.talker.on_closing()
        self.plugged = False

    def unplug(self) -> None:
        self.plugged = False

    def set_dtr(self, *, on: bool) -> None:
        assert on

    def write(self, data: bytes) -> None:
        if not self.plugged:
            raise NotConnected("head: /dev/nano: no such device")
        self.sent += data
        self._pending += self.device.feed(data, self.clock.now())

    def plug(self) -> None:
        self.plugged = True
        self.talker.on_connected()

    def wake(self) -> None:
        self._dozes_until = 0.0

    def run(self, seconds: float) -> None:
        """Pulse every 20 ms, as the link's thread does, or as seldom as the board wants it."""
        for _ in range(round(seconds / 0.02)):
            self.clock.advance(0.02)
            self._pending += self.device.poll(self.clock.now())
            if self.clock.now() < self._dozes_until - 1e-9:
                continue
            data, self.noise = self.noise, b""
            if self.clock.now() >= self.late_until:
                data, self._pending = data + self._pending, b""
            if data and self.clock.now() >= self.deaf_until:
                self.talker.on_data(data)
            self._dozes_until = self.clock.now() + (self.talker.on_poll() or 0.0)
            self.served += 1

    def said(self) -> bytes:
        """Return what the computer has sent since this was asked last, but for what asks whether the board is there."""
        data, self.sent = self.sent, b""
        self.probes += data.count(wire.PROBE)
        return data.replace(wire.PROBE, b"").replace(wire.NUDGE, b"")


@dataclass
class Bench:
    """A head, its board, the wire between them, and what the head reports."""

    clock: ManualClock
    link: Wire
    head: ArduinoHead
    notices: list[DeviceStatus]
    changes: list[HeadPose | None]

    def begin(self) -> None:
        """Plug the board in, wait until the head has come to its pose, and forget how it came there."""
        self.link.plug()
        self.link.run(1.0)
        self.link.said()
        self.link.device.commands.clear()
        self.changes.clear()


def leaps(commands: list[tuple[int, int]], index: int) -> int:
    """Return the widest step, in degrees, between two commands to a servo that begin where the sketch has put it."""
    angles = [ENCODER_SKETCH_STARTS[index], *(angle for number, angle in commands if number == index)]
    return max(abs(later - sooner) for sooner, later in pairwise(angles))


def bench(
    device: VirtualRodney | None = None,
    *,
    boot_delay: float = 0.0,
    speed: float = 1.0,
    acceleration: float = radians(3000),  # so hard that it hardly counts
    start: HeadPose | None = None,
    remembered: ServoAngleStore | None = None,
) -> Bench:
    clock = ManualClock(100.0)
    notices: list[DeviceStatus] = []
    changes: list[HeadPose | None] = []
    link = Wire(device or VirtualRodney(logs_angles=True), clock)
    head = ArduinoHead(
        ArduinoBoard(link, clock, boot_delay=boot_delay, report=notices.append, angle_store=remembered),
        clock,
        pan=PAN,
        tilt=TILT,
        speed=speed,
        acceleration=acceleration,
        changed=lambda: changes.append(head.pose().value),
        start=start or HeadPose(0.0, 0.0),
    )
    head.open()
    return Bench(clock, link, head, notices, changes)


def test_arduino_head_implements_the_head_protocol() -> None:
    head: Head = bench().head
    assert (head.name, head.limits.pan, head.limits.speed) == ("head", PAN.range, 1.0)


def test_resting_head_is_polled_slowly() -> None:
    b = bench()
    b.begin()
    b.link.run(12.0)  # the board asks for the time again and again
    b.link.served = 0
    b.link.run(5.0)
    assert b.link.served == pytest.approx(5.0 / IDLE_POLL_INTERVAL, abs=10)
    b.head.look(HeadPose(radians(30), 0.0))
    b.link.run(0.1)
    assert b.link.device.commands
    b.link.run(1.0)
    pose = b.head.pose().value
    assert pose is not None
    assert pose.pan == pytest.approx(radians(30))
    b.link.served = 0
    b.link.run(1.0)
    assert b.link.served == pytest.approx(1.0 / IDLE_POLL_INTERVAL, abs=3)
    assert [notice.kind for notice in b.notices] == ["online"]


def test_board_restart_is_noticed_while_the_head_rests() -> None:
    b = bench()
    b.begin()
    b.link.run(12.0)
    b.link.device.reset(b.clock.now())
    b.link.run(5.0)
    b.head.look(HeadPose(radians(30), 0.0))
    b.link.run(3.0)
    assert any("the board has restarted" in notice.message for notice in b.notices)
    assert not b.head.latched


def test_head_waits_for_the_boot_then_goes_to_its_start_pose() -> None:
    b = bench(
        VirtualRodney(boot_delay=1.5), boot_delay=2.0, speed=radians(50), start=HeadPose(radians(10), radians(-20))
    )
    b.link.plug()
    b.link.run(1.9)
    assert (b.link.said(), b.link.probes) == (b"", 1)
    assert b.head.health().detail == "head: /dev/nano: open, waiting for the board to boot"
    b.link.run(1.0)
    assert [sent[0] for sent in servos(b.link.said())][:4] == [0, 1, 0, 1]
    assert max(leaps(b.link.device.commands, index) for index in (0, 1)) <= 2
    assert {(0, 100), (1, 110)} <= {*b.link.device.commands}
    assert b.head.health().online
    assert [(one.kind, one.message) for one in b.notices] == [
        ("online", "the board takes servo_msgs/servo_array as topic 100")
    ]


def test_head_moves_degree_by_degree_at_its_speed() -> None:
    b = bench(speed=radians(50))
    b.begin()
    assert b.head.look(HeadPose(radians(30), 0.0)) == HeadPose(radians(30), 0.0)
    b.link.run(0.3)
    assert degrees(b.head) == pytest.approx((15, 0), abs=1)
    b.link.run(0.5)
    sent = servos(b.link.said())
    assert {index for index, _ in sent} == {0}
    assert all(0 < later[1] - sooner[1] <= 2 for sooner, later in pairwise([(0, 90), *sent]))
    assert degrees(b.head) == pytest.approx((30, 0))
    assert len(b.changes) == len(sent) >= 28
    assert b.link.device.angle(0, b.clock.now()) == 120


def test_first_degree_is_sent_at_once_and_a_trembling_goal_sends_none() -> None:
    b = bench(VirtualRodney(tacho=True), speed=radians(120), acceleration=radians(400))
    b.begin()
    for _ in range(10):
        b.link.said()
        b.head.look(HeadPose(radians(30), radians(-0.4)))
        b.link.run(0.06)
        assert servos(b.link.said())[0] == (0, 91)
        b.head.look(HeadPose(0.0, 0.0))
        b.link.run(0.61)
    b.head.stop()
    b.link.run(1.0)
    b.link.device.commands.clear()
    here = b.head.pose().value
    assert here is not None
    for tremble in (0.4, -0.4, 0.3):
        b.head.look(HeadPose(here.pan + radians(tremble), here.tilt))
        b.link.run(0.5)
    assert b.link.device.commands == []


@pytest.mark.parametrize("rest", [10.0, 10.4, 9.6, -10.4, -9.6])
@pytest.mark.parametrize("way", [30, -30])
def test_first_degree_is_sent_at_once_from_between_two_degrees(rest: float, way: int) -> None:
    b = bench(VirtualRodney(tacho=True), speed=radians(120), acceleration=radians(400))
    b.begin()
    resting = HeadPose(radians(rest), radians(-rest))
    assert b.head.look(resting) == resting
    b.link.run(1.0)
    assert degrees(b.head) == pytest.approx((round(rest), -round(rest)))
    b.link.said()
    b.head.look(HeadPose(radians(rest + way), radians(-rest)))
    b.link.run(0.06)
    assert servos(b.link.said())[0] == (0, 90 + round(rest) + (1 if way > 0 else -1))


@given(st.booleans(), st.floats(-45, 45), st.integers(0, 180), st.integers(0, 180))
def test_next_degree_follows_from_a_whole_degree(flip: bool, trim: float, here: int, end: int) -> None:
    axis = ServoAxis(0, -math.pi, math.pi, flip=flip, trim=radians(trim))
    follows = here + (end > here) - (end < here)
    assert axis.next_degree(axis.to_radians(here), axis.to_radians(end)) == follows


@given(st.booleans(), st.floats(-45, 45), st.floats(-180, 180))
def test_nearest_angle_is_within_half_a_degree(flip: bool, trim: float, angle: float) -> None:
    axis = ServoAxis(0, -math.pi, math.pi, flip=flip, trim=radians(trim))
    held = min(max(radians(angle), axis.range[0]), axis.range[1])
    nearest = axis.nearest_angle(held)
    assert math.degrees(abs(nearest - held)) <= 0.5 + 1e-9
    assert axis.nearest_angle(nearest) == nearest


@given(st.booleans(), st.floats(-45, 45), st.floats(-80, 80), st.floats(-80, 80))
def test_next_degree_is_less_than_a_degree_ahead(flip: bool, trim: float, angle: float, goal: float) -> None:
    axis = ServoAxis(0, -math.pi, math.pi, flip=flip, trim=radians(trim))
    angle, goal = (min(max(each, math.degrees(axis.range[0])), math.degrees(axis.range[1])) for each in (angle, goal))
    sent, end = axis.next_degree(radians(angle), radians(goal)), axis.to_degrees(radians(goal))
    exact = math.degrees(axis.sign * radians(angle) + axis.trim) + 90
    assert 0 <= sent <= 180
    assert abs(sent - exact) <= 1 + 1e-9
    assert min(exact, end) - 1 < sent < max(exact, end) + 1
    if abs(exact - end) > 1:
        assert (sent - exact) * (end - exact) > 0
    assert axis.next_degree(radians(goal), radians(goal)) == end


def test_goal_beyond_the_limits_is_clamped_and_returned() -> None:
    b = bench()
    b.link.plug()
    b.link.run(0.1)
    assert b.head.look(HeadPose(9.0, 9.0)) == HeadPose(radians(80), radians(20))
    b.link.run(2.0)
    assert b.link.device.commands[-1] == (0, 170)
    assert (1, 70) in b.link.device.commands
    assert max(angle for _, angle in b.link.device.commands) == 170


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_goal_that_is_not_finite_is_refused(bad: float) -> None:
    b = bench()
    b.link.plug()
    b.link.run(0.1)
    for goal in (HeadPose(bad, 0.0), HeadPose(0.0, bad)):
        with pytest.raises(BadRequest, match="not a finite number"):
            b.head.look(goal)


def test_speed_that_is_not_positive_is_refused() -> None:
    for speed in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="is not positive"):
            bench(speed=speed)


def test_two_axes_on_one_servo_are_refused() -> None:
    b = bench()
    with pytest.raises(ValueError, match="both servo 0"):
        ArduinoHead(b.head.board, b.clock, pan=PAN, tilt=PAN, speed=1.0)


def test_stopped_head_holds_its_angle() -> None:
    b = bench(speed=radians(50))
    b.begin()
    b.head.look(HeadPose(radians(30), radians(-30)))
    b.link.run(0.2)
    b.head.stop()
    b.head.stop()
    held = degrees(b.head)
    assert held == pytest.approx((10, -10), abs=1.01)
    b.link.said()
    b.link.run(1.0)
    assert degrees(b.head) == held
    assert b.link.said() == b""


def test_past_pose_is_known() -> None:
    b = bench(speed=radians(50))
    assert b.head.pose_at(b.clock.now()) is None
    b.link.plug()
    b.link.run(0.5)
    b.head.look(HeadPose(radians(40), 0.0))
    begun = b.clock.now()
    b.link.run(1.0)
    for seconds, angle in ((-0.2, 0), (0.2, 10), (0.41, 20.5), (0.8, 40), (5.0, 40)):
        past = b.head.pose_at(begun + seconds)
        assert past is not None
        assert past.pan == pytest.approx(radians(angle), abs=radians(1.01))


def test_pose_is_none_then_good_then_stale() -> None:
    b = bench()
    assert (b.head.pose().quality, b.head.pose().value) == (Quality.NONE, None)
    b.link.plug()
    b.link.run(0.1)
    assert b.head.pose().good
    stamp = b.head.pose().stamp
    b.link.close()
    b.clock.advance(1.0)
    assert (b.head.pose().quality, b.head.pose().stamp) == (Quality.STALE, stamp)


def test_time_request_is_answered_with_the_time_of_the_clock() -> None:
    b = bench()
    b.begin()
    b.link.run(1.7)
    b.link.said()
    b.link.run(2.52)
    (frame,) = wire.RosserialFrameFinder().feed(b.link.said())
    assert frame.topic == wire.TIME
    assert wire.RosserialTime.unpack(frame.data).seconds == pytest.approx(b.clock.now() - 1.26, abs=1.26)


def test_synchronised_session_requests_topics_once() -> None:
    b = bench(VirtualRodney(tacho=True))
    b.link.plug()
    b.link.run(60)
    counters = b.head.health().counters
    assert (counters["requests"], counters["unknown topics"], counters["skipped bytes"]) == (1, 0, 0)
    assert counters["times"] == 27  # three of them for the nudges


def test_silent_board_is_probed_again_and_a_hint_is_given() -> None:
    b = bench(VirtualRodney(boot_delay=1000))
    b.link.plug()
    b.link.run(10)
    assert (b.link.said(), b.link.probes) == (b"", 10)
    health = b.head.health()
    assert not health.online
    assert "waiting for the topics of the board; does it have the Rodney sketch?" in health.detail
    assert "57600 on a Nano" in health.hint
    with pytest.raises(NotConnected, match="waiting for the topics") as caught:
        b.head.look(HeadPose(0.1, 0.0))
    assert caught.value.hint == health.hint


def test_chatter_of_another_sketch_is_reported() -> None:
    b = bench(VirtualRodney(boot_delay=1000))
    b.link.plug()
    b.link.noise = b"Temperature: 21.5\r\n"
    b.link.run(1)
    assert "19 bytes received at 57600 baud, none of them rosserial" in b.head.health().detail
    assert "miniterm /dev/nano 57600" in b.head.health().hint


def test_noise_and_wrong_checksums_are_counted_and_skipped() -> None:
    b = bench()
    b.link.plug()
    b.link.noise = b"\x00\xff\xff\xfe\x10" + wire.REQUEST_TIME[:-1] + b"\x00"
    b.link.run(0.3)
    health = b.head.health()
    assert health.online
    assert health.counters["checksum errors"] >= 1
    assert health.counters["skipped bytes"] == 5 + len(wire.REQUEST_TIME)


def test_false_header_does_not_delay_the_next_frame() -> None:
    b = bench()
    b.link.plug()
    b.link.noise = bytes.fromhex("FF FE 00 01 FE")  # announces 256 bytes that never come
    b.link.run(0.3)
    assert b.head.health().online


def test_other_message_definitions_are_named_and_nothing_moves() -> None:
    other = wire.RosserialTopic("servo", "std_msgs/UInt16", "1df79edf208b629fe6b81923a544552d")
    b = bench(VirtualRodney(servo_topic=other))
    b.link.plug()
    b.link.run(10)
    (notice,) = b.notices
    assert notice.kind == "fault"
    for part in ("std_msgs/UInt16", other.md5, "servo_msgs/servo_array", wire.SERVO_TOPIC.md5):
        assert part in notice.message
    assert "make_libraries" in notice.hint
    assert notice.message in b.head.health().detail
    assert b.link.device.commands == []
    with pytest.raises(NotConnected):
        b.head.look(HeadPose(0.1, 0.0))


def test_board_without_servos_is_reported_with_its_topics() -> None:
    b = bench(
        VirtualRodney(
            tacho=True, servo_topic=wire.RosserialTopic("led", "std_msgs/Empty", "d41d8cd98f00b204e9800998ecf8427e")
        )
    )
    b.link.plug()
    b.link.run(1)
    assert "the board has the topics tacho, led, but no servo" in b.head.health().detail
    assert b.link.device.commands == []


def test_unknown_topic_triggers_a_topic_request() -> None:
    b = bench()
    b.link.plug()
    b.link.run(4)
    asked = b.head.health().counters["requests"]
    b.link.noise = wire.RosserialFrame(125, bytes(8)).pack()
    b.link.run(0.1)
    assert b.head.health().counters["unknown topics"] == 1
    assert b.head.health().counters["requests"] == asked + 1
    assert b.head.health().online


def test_board_log_is_counted_and_its_warnings_are_reported() -> None:
    b = bench(VirtualRodney(tacho=True))
    b.link.plug()
    b.link.run(0.1)
    b.link.device.log(wire.RosserialLog(1, "ready"))
    b.link.device.log(wire.RosserialLog(2, "supply is low"))
    b.link.run(0.1)
    assert b.head.health().counters["log lines"] == 2
    assert [one.message for one in b.notices if one.kind == "fault"] == ["log of the board: supply is low"]


def test_malformed_messages_are_counted_and_skipped() -> None:
    b = bench()
    b.link.plug()
    b.link.noise = (
        wire.RosserialFrame(wire.SUBSCRIBER, b"\x64\x00\xff").pack() + wire.RosserialFrame(wire.LOG, b"").pack()
    )
    b.link.run(0.3)
    assert b.head.health().counters["malformed"] == 2
    assert b.head.health().online


def test_head_never_leaps_from_the_start_angles_of_the_sketch() -> None:
    board = VirtualRodney(boot_delay=1.0, logs_angles=True)
    b = bench(board, boot_delay=1.5, speed=radians(50), start=HeadPose(radians(-40), 0.3))
    b.link.plug()
    b.link.run(4.0)
    for index in (0, 1):
        assert leaps(board.commands, index) <= 2
    b.head.look(HeadPose(radians(50), 0.0))
    b.link.run(3.0)
    assert degrees(b.head) == pytest.approx((50, 0))
    b.link.unplug()
    board.reset(b.clock.advance(1.0))
    board.commands.clear()
    b.link.plug()
    b.link.run(1.0)
    assert b.head.pose().quality is Quality.STALE
    b.link.run(3.0)
    assert board.commands == []  # it stays where its sketch has put it
    assert b.head.pose().good
    assert degrees(b.head) == pytest.approx((0, -30))
    b.head.look(HeadPose(radians(10), 0.0))
    b.link.run(2.0)
    assert max(leaps(board.commands, index) for index in (0, 1)) <= 2


def test_head_keeps_its_speed_after_a_reset() -> None:
    board = VirtualRodney(boot_delay=1.0, logs_angles=True)
    b = bench(board, boot_delay=1.5, speed=radians(20), start=HeadPose(radians(40), 0.0))
    b.link.plug()
    b.link.run(1.62)
    for _ in range(4):
        before = board.angle(0, b.clock.now())
        b.link.run(0.5)
        assert board.angle(0, b.clock.now()) - before == pytest.approx(10, abs=1.01)


@pytest.mark.parametrize("board", [VirtualRodney(logs_angles=True), VirtualRodney(tacho=True, boot_delay=0.4)])
def test_board_reset_is_noticed_and_the_head_stays(board: VirtualRodney) -> None:
    b = bench(board, speed=radians(50))
    b.link.plug()
    b.link.run(3.0)
    b.head.look(HeadPose(radians(20), 0.0))
    b.link.run(1.0)
    assert board.angle(0, b.clock.now()) == 110
    before = b.head.health().reconnected_at
    board.reset(b.clock.now())
    board.commands.clear()
    b.link.run(4.0)
    assert "the board has restarted" in [one.message for one in b.notices] or "offline" in [
        one.kind for one in b.notices
    ]
    assert (board.commands, board.angle(0, b.clock.now())) == ([], 90)
    assert degrees(b.head) == pytest.approx((0, -30))
    assert b.head.health().reconnected_at != before  # what was decided before moves it no more
    b.head.look(HeadPose(radians(20), 0.0))
    b.link.run(2.0)
    assert max(leaps(board.commands, index) for index in (0, 1)) <= 2
    assert degrees(b.head) == pytest.approx((20, 0))


def test_reset_is_noticed_within_200_ms_with_encoders() -> None:
    b = bench(VirtualRodney(tacho=True, boot_delay=0.4))
    b.link.plug()
    b.link.run(3.0)
    b.link.said()
    asked = b.link.probes
    b.link.device.reset(b.clock.now())
    b.link.run(0.24)
    b.link.said()
    assert b.link.probes == asked + 1
    b.link.run(0.26)
    assert b.head.pose().quality is Quality.STALE


def test_running_board_is_recognised_and_its_servo_angles_are_restored(
    tmp_path: Path,
) -> None:
    node = tmp_path / "ttyACM0"
    node.touch()
    board = VirtualRodney(tacho=True, native_usb=True, boot_delay=0.4)
    for goal in (-29, 10, 20):
        memory = ServoAngleStore(tmp_path, str(node))
        b = bench(board, boot_delay=2.0, remembered=memory, speed=radians(120))
        b.link.device.open_port(b.clock.now())
        b.link.plug()
        b.link.run(0.3 if goal != -29 else 3.0)
        b.head.look(HeadPose(0.0, radians(goal)))
        b.link.run(2.0)
        assert degrees(b.head) == pytest.approx((0, goal))
        b.head.close()
        board.poll(b.clock.now())
    assert board.max_step <= 8
    node.unlink()
    node.touch()
    (tmp_path / "another").touch()
    assert ServoAngleStore(tmp_path, str(tmp_path / "another")).pop() == {}


def test_damaged_angle_store_is_empty_and_a_pipe_does_not_block(tmp_path: Path) -> None:
    node = tmp_path / "ttyACM0"
    node.touch()
    memory = ServoAngleStore(tmp_path, str(node))
    memory.save({0: 90})
    (kept,) = tmp_path.glob("servos*.json")
    whole = kept.read_text()
    angles = [whole.replace('"0": 90', f'"0": {each}') for each in ("1e999", "NaN", '"x"', "[]")]
    for text in ("", "[" * 100_000, "[" * 9_000, *angles):
        kept.write_text(text)
        assert memory.pop() == {}, text[:80]
        kept.unlink(missing_ok=True)
    os.mkfifo(kept)
    assert memory.pop() == {}


def test_pose_is_stale_from_a_reset_until_the_board_accepts_angles() -> None:
    b = bench(VirtualRodney(boot_delay=8.0))
    b.link.plug()
    b.link.run(10.0)
    assert b.head.pose().good
    b.link.device.reset(b.clock.now())
    b.link.run(3.2)
    assert b.head.pose().quality is Quality.STALE
    b.link.run(6.0)
    assert b.head.pose().good


def test_one_garbled_time_request_is_not_a_reset() -> None:
    b = bench()
    b.begin()
    b.link.deaf_until = b.clock.now() + 2.0  # one question falls into this
    b.link.run(10.0)
    assert [one.kind for one in b.notices] == ["online"]
    assert b.link.device.commands == []


def test_one_late_answer_is_not_a_reset() -> None:
    b = bench()
    b.begin()
    b.link.late_until = b.clock.now() + 0.6
    b.head.look(HeadPose(radians(20), 0.0))
    b.link.run(0.5)
    assert b.link.device.commands == []
    assert b.notices[-1].kind == "offline"
    b.link.run(1.0)
    assert b.head.latched == ""
    b.head.look(HeadPose(radians(20), 0.0))
    b.link.run(1.0)
    assert degrees(b.head) == pytest.approx((20, 0))


def test_reset_before_a_late_answer_is_noticed() -> None:
    b = bench()
    b.begin()
    b.link.run(0.2)
    b.link.device.reset(b.clock.now())
    b.link.late_until = b.clock.now() + 0.6
    b.head.look(HeadPose(radians(20), 0.0))
    b.link.run(1.5)
    assert b.link.device.commands == []


def test_enable_reports_unknown_servo_angles() -> None:
    b = bench()
    b.begin()
    b.link.unplug()
    b.clock.advance(12.0)
    b.link.device.power_on(b.clock.now())
    b.link.plug()
    b.link.run(2.0)
    assert b.head.latched == "a reset of its board cannot be ruled out, so its servo angles are unknown"
    assert b.link.device.commands == []


@pytest.mark.parametrize("pan_alone", [False, True])
def test_unknown_servo_angles_are_not_stored(pan_alone: bool, tmp_path: Path) -> None:
    (node := tmp_path / "tty").touch()
    memory = ServoAngleStore(tmp_path, str(node))
    b = bench(remembered=memory)
    b.begin()
    b.head.look(HeadPose(radians(20), 0.0))
    b.link.run(2.0)
    b.link.unplug()
    b.clock.advance(12.0)
    b.link.device.power_on(b.clock.now())
    b.link.device.commands.clear()
    b.link.plug()
    b.link.run(2.0)
    assert b.head.latched.startswith("a reset of its board")
    if pan_alone:
        b.head.enable()
        b.head.look(HeadPose(radians(-20), 0.0))
        b.link.run(2.0)
        assert {index for index, _ in b.link.device.commands} == {0}
    b.head.close()
    assert memory.pop() == {}


def test_unrequested_topics_mean_a_restarted_board() -> None:
    b = bench()
    b.begin()
    b.head.look(HeadPose(radians(20), 0.0))
    b.link.run(4.0)
    b.link.device.reset(b.clock.now())
    b.link.device.commands.clear()
    b.link.noise = wire.RosserialFrame(wire.SUBSCRIBER, wire.TopicInfo(100, wire.SERVO_TOPIC, 512).pack()).pack()
    b.link.run(1.0)
    assert b.link.device.commands == []
    assert b.notices[-1].message == "the board has restarted"
    assert degrees(b.head) == pytest.approx((0, -30))


def test_goal_is_dropped_on_disconnect() -> None:
    b = bench(speed=radians(50))
    b.begin()
    b.head.look(HeadPose(radians(60), 0.0))
    b.link.run(0.4)
    b.link.unplug()
    with pytest.raises(NotConnected, match="no such device"):
        b.head.look(HeadPose(0.0, 0.0))
    held = degrees(b.head)
    b.clock.advance(30)
    b.link.device.commands.clear()
    b.link.plug()
    b.link.run(1.0)
    assert degrees(b.head) == held
    assert b.link.device.commands == []
    with pytest.raises(DeviceFault, match="head: stopped: "):
        b.head.look(HeadPose(0.0, 0.0))
    b.head.enable()
    b.head.look(HeadPose(0.0, 0.0))
    b.link.run(1.0)
    assert degrees(b.head) == pytest.approx((0, 0))


def test_close_stops_the_board_and_may_be_repeated() -> None:
    b = bench()
    b.head.close()
    b.begin()
    b.head.close()
    b.head.close()
    b.head.rest()
    assert b.link.said() == wire.STOP_SENDING


def test_two_heads_share_a_board() -> None:
    b = bench()
    other = ArduinoHead(
        b.head.board, b.clock, pan=RODNEY["index1 pan"], tilt=RODNEY["index1 tilt"], speed=3.0, name="other head"
    )
    other.open()
    b.begin()
    b.head.look(HeadPose(radians(10), 0.0))
    other.look(HeadPose(radians(-20), radians(15)))
    b.link.run(1.0)
    assert [b.link.device.angle(index, b.clock.now()) for index in range(4)] == [100, 90, 70, 105]
    assert degrees(b.head) == pytest.approx((10, 0))
    assert degrees(other) == pytest.approx((-20, 15))
    b.head.close()
    assert b.link.online
    other.look(HeadPose(0.0, 0.0))
    b.link.run(1.0)
    assert [b.link.device.angle(index, b.clock.now()) for index in range(4)] == [100, 90, 90, 90]
    b.link.unplug()
    with pytest.raises(NotConnected):
        other.look(HeadPose(0.0, 0.0))


def test_trim_while_moving_is_smooth_and_keeps_the_goal() -> None:
    b = bench(speed=radians(50), acceleration=radians(400))
    b.begin()
    b.head.look(HeadPose(radians(20), radians(-10)))
    b.link.run(1.0)
    b.link.device.commands.clear()
    assert b.head.trim(pan=radians(12), tilt=radians(3)) == pytest.approx((radians(12), radians(3)))
    assert degrees(b.head)[0] == pytest.approx(20)
    b.link.run(1.0)
    assert [angle for index, angle in b.link.device.commands if index == 0] == [*range(111, 123)]
    assert [angle for index, angle in b.link.device.commands if index == 1] == [*range(101, 104)]
    assert degrees(b.head) == pytest.approx((20, -10))
    assert b.head.trim(pan=radians(-45)) == pytest.approx((radians(-45), radians(3)))
    b.link.run(3.0)
    assert b.link.device.angle(0, b.clock.now()) == 65


def test_trim_survives_a_reset_and_may_be_set_before_connecting() -> None:
    b = bench(VirtualRodney(boot_delay=1.0), boot_delay=1.5)
    b.head.trim(tilt=radians(-8))
    b.link.plug()
    b.link.run(5.0)
    assert b.link.device.angle(1, b.clock.now()) == 82
    assert degrees(b.head) == pytest.approx((0, 0))
    b.link.device.reset(b.clock.now())
    b.link.run(4.0)
    b.head.look(HeadPose(0.0, 0.0))
    b.link.run(4.0)
    assert b.link.device.angle(1, b.clock.now()) == 82


def test_sent_angles_respect_the_acceleration_limit() -> None:
    speed, acceleration = radians(120), radians(400)
    b = bench(speed=speed, acceleration=acceleration)
    b.begin()
    angles = []
    for goal in (60, -70, 10, 10):
        b.head.look(HeadPose(radians(goal), 0.0))
        for _ in range(50):
            b.link.run(0.02)
            angles.append(degrees(b.head)[0])
    # Over five pulses a whole degree more or less counts for little.
    velocities = [(later - sooner) / 0.1 for sooner, later in zip(angles, angles[5:], strict=False)]
    accelerations = [(later - sooner) / 0.1 for sooner, later in zip(velocities, velocities[5:], strict=False)]
    assert max(map(abs, velocities)) <= math.degrees(speed) + 10
    assert math.degrees(acceleration) / 2 < max(map(abs, accelerations)) <= math.degrees(acceleration) + 200
    assert angles[-1] == pytest.approx(10)


def test_wheel_speeds_come_from_the_encoders_of_the_later_sketch() -> None:
    b = bench(VirtualRodney(tacho=True))
    assert b.head.board.wheels().quality is Quality.NONE
    b.link.device.wheels = wire.Tacho(30.0, -60.0)
    b.link.plug()
    b.link.run(1.0)
    rates = b.head.board.wheels()
    assert rates.good
    assert rates.value is not None
    assert (rates.value.left, rates.value.right) == pytest.approx((math.pi, -2 * math.pi))
    assert b.clock.now() - rates.stamp <= 0.1
    assert b.head.health().counters["tachos"] >= 15
    b.link.unplug()
    b.clock.advance(1.0)
    assert b.head.board.wheels().quality is Quality.STALE


def test_nan_of_an_encoder_is_malformed_and_the_first_sketch_has_none() -> None:
    b = bench(VirtualRodney(tacho=True))
    b.link.device.wheels = wire.Tacho(math.nan, 1.0)
    b.link.plug()
    b.link.run(1.0)
    assert b.head.board.wheels().quality is Quality.NONE
    assert b.head.health().counters["malformed"] >= 15
    b = bench()
    b.begin()
    assert b.head.board.wheels().value is None


def test_other_encoder_message_is_named_and_the_head_still_turns() -> None:
    b = bench()
    b.link.plug()
    other = wire.RosserialTopic("tacho", "std_msgs/Float64", "fdb28210bfa9d7c91146260178d9a584")
    b.link.noise = wire.RosserialFrame(wire.PUBLISHER, wire.TopicInfo(125, other, 512).pack()).pack()
    b.link.run(0.1)
    (fault,) = [one for one in b.notices if one.kind == "fault"]
    assert other.md5 in fault.message
    assert "tacho_msgs" in fault.hint
    assert b.head.health().online


WIRE_NOISE = st.one_of(
    st.binary(max_size=40),
    st.builds(lambda topic, data: wire.RosserialFrame(topic, data).pack(), st.integers(0, 130), st.binary(max_size=30)),
    st.sampled_from([wire.REQUEST_TIME, wire.REQUEST_TIME[:7], wire.HEADER, wire.STOP_SENDING]),
)


@given(st.lists(st.tuples(WIRE_NOISE, st.sampled_from(["", "reset", "unplug", "deaf"])), max_size=6))
def test_head_stays_within_bounds_and_recovers_from_any_input(
    mishaps: list[tuple[bytes, str]],
) -> None:
    b = bench(VirtualRodney(boot_delay=0.5, tacho=True), boot_delay=0.6)
    b.link.plug()
    for noise, mishap in mishaps:
        b.link.noise = noise
        if mishap == "reset":
            b.link.device.reset(b.clock.now())
        elif mishap == "deaf":
            b.link.deaf_until = b.clock.now() + 1.0
        elif mishap == "unplug":
            b.link.unplug()
            b.link.device.reset(b.clock.advance(0.5))
            b.link.plug()
        b.link.run(0.4)
        b.head.stop()
        b.head.pose()
    b.link.run(16.0)
    assert b.head.health().online
    b.head.enable()
    b.head.look(HeadPose(radians(25), radians(-10)))
    b.link.run(2.0)
    assert (b.link.device.angle(0, b.clock.now()), b.link.device.angle(1, b.clock.now())) == (115, 100)
    assert all(0 <= angle <= 180 and index in (0, 1) for index, angle in b.link.device.commands)


# --- the whole of it, in real time ------------------------------------------------------------------------------------


@dataclass
class Rig:
    """A head over a pseudo-terminal."""

    clock: PatientClock
    device: VirtualRodney
    terminal: PseudoTerminal
    head: ArduinoHead
    notices: list[DeviceStatus] = field(default_factory=list)


@pytest.fixture
def rig() -> Iterator[Rig]:
    clock, device = PatientClock(), VirtualRodney(tacho=True)
    terminal = PseudoTerminal("nano", device, clock)
    notices: list[DeviceStatus] = []
    link = SerialLink("head", terminal.path, 57600, retry_interval=0.05, report=notices.append)
    board = ArduinoBoard(link, clock, boot_delay=0.0, report=notices.append)
    head = ArduinoHead(board, clock, pan=PAN, tilt=TILT, speed=radians(200))
    try:
        yield Rig(clock, device, terminal, head, notices)
    finally:
        head.close()
        terminal.close()


def online(rig: Rig) -> bool:
    return rig.head.health().online


def looks(rig: Rig, pan: float, tilt: float) -> Callable[[], bool]:
    """Return a condition: the servos stand at these angles, and the head knows it."""

    def there() -> bool:
        now = rig.clock.now()
        stands = (rig.device.angle(0, now), rig.device.angle(1, now)) == (90 + pan, 90 - tilt)
        return stands and rig.head.pose().good and degrees(rig.head) == pytest.approx((pan, tilt))

    return there


def test_head_turns_over_a_serial_port(rig: Rig) -> None:
    rig.terminal.open()
    rig.head.open()
    wait_until(looks(rig, 0, 0))
    rig.head.look(HeadPose(radians(30), radians(15)))
    wait_until(looks(rig, 30, 15))
    assert rig.device.commands[0] == (1, 119)
    assert rig.device.commands[-1][0] in (0, 1)
    assert [angle for index, angle in rig.device.commands if index == 0] == sorted(
        {angle for index, angle in rig.device.commands if index == 0}
    )


def test_absent_board_is_found_when_it_appears(rig: Rig) -> None:
    rig.head.open()
    wait_until(lambda: "no such device" in rig.head.health().detail)
    with pytest.raises(NotConnected, match="no such device"):
        rig.head.look(HeadPose(0.1, 0.0))
    rig.terminal.open()
    wait_until(lambda: online(rig))


def test_reconnected_head_stays_until_commanded(rig: Rig) -> None:
    rig.terminal.open()
    rig.head.open()
    wait_until(lambda: online(rig))
    rig.head.look(HeadPose(radians(-20), 0.0))
    wait_until(looks(rig, -20, 0))
    rig.terminal.unplug()
    wait_until(lambda: not online(rig))
    assert rig.head.pose().quality is Quality.STALE
    rig.terminal.replug()
    wait_until(lambda: online(rig))
    wait_until(looks(rig, 0, -30))
    rig.head.enable()
    rig.head.look(HeadPose(radians(-20), 0.0))
    wait_until(looks(rig, -20, 0))
    assert "offline" in [one.kind for one in rig.notices]


def test_distorted_line_is_survived(rig: Rig) -> None:
    rig.terminal.open()
    rig.terminal.distort = lambda data: b"\x00\xff" + data.replace(b"servo_array", b"servo_arrbz")
    rig.head.open()
    wait_until(lambda: rig.head.health().counters.get("checksum errors", 0) > 0)
    assert not online(rig)
    rig.terminal.distort = bytes
    wait_until(lambda: online(rig))
    rig.head.look(HeadPose(radians(10), 0.0))
    wait_until(looks(rig, 10, 0))


def test_head_can_be_closed_in_any_state_and_reopened(rig: Rig) -> None:
    rig.head.close()
    rig.terminal.open()
    for _ in range(2):
        rig.head.open()
        wait_until(lambda: online(rig))
        rig.head.close()
        assert not online(rig)
