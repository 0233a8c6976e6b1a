"""The sketch's behaviour towards the computer, without any terminal: bytes and the time in, bytes out."""

from random import Random

import pytest

from drivers.arduino import wire
from drivers.arduino.virtual import UNSENT_SKETCH_ANGLES, VirtualRodney
from drivers.head.axis import ENCODER_SKETCH_STARTS
from drivers.sim.servo import SERVO_SPEED
from tests.machines import walk


def command(index: int, angle: int) -> bytes:
    return wire.RosserialFrame(100, wire.ServoAngle(index, angle).pack()).pack()


def answer_time(device: VirtualRodney, now: float) -> None:
    device.feed(wire.RosserialFrame(wire.TIME, wire.RosserialTime(now).pack()).pack(), now)


def topics(data: bytes) -> list[int]:
    finder = wire.RosserialFrameFinder()
    found = [frame.topic for frame in finder.feed(data)]
    assert finder.skipped == 0
    return found


def test_topic_request_returns_the_time_request_and_the_servo_topic() -> None:
    golden = (
        wire.REQUEST_TIME
        + wire.RosserialFrame(wire.SUBSCRIBER, wire.TopicInfo(100, wire.SERVO_TOPIC, 512).pack()).pack()
    )
    assert VirtualRodney().feed(wire.REQUEST_TOPICS, 1.0) == golden


def test_encoder_sketch_publishes_its_encoders() -> None:
    device = VirtualRodney(tacho=True)
    device.wheels = wire.Tacho(10.0, -10.0)
    assert topics(device.feed(wire.REQUEST_TOPICS, 1.0)) == [wire.TIME, wire.PUBLISHER, wire.SUBSCRIBER]
    said = device.poll(1.01)
    assert said == bytes.fromhex("FF FE 08 00 F7 7D 00 00 00 20 41 00 00 20 C1 40")
    assert device.poll(1.04) == b""
    assert device.poll(1.07) == said


def test_booting_board_ignores_requests() -> None:
    device = VirtualRodney(boot_delay=2.0)
    assert device.poll(10.0) == b""
    assert device.feed(wire.REQUEST_TOPICS, 11.9) == b""
    assert device.feed(wire.REQUEST_TOPICS, 12.0) != b""


def test_configured_board_requests_the_time_every_2_5_seconds() -> None:
    device = VirtualRodney()
    assert device.poll(0.0) + device.poll(5.0) == b""
    device.feed(wire.REQUEST_TOPICS, 5.0)
    assert device.poll(7.4) == b""
    assert device.poll(7.5) == wire.REQUEST_TIME
    assert device.poll(9.9) == b""


def test_board_is_silent_11_seconds_after_the_last_answer() -> None:
    device = VirtualRodney(tacho=True)
    device.feed(wire.REQUEST_TOPICS, 0.0)
    answer_time(device, 4.0)
    assert device.poll(15.0) != b""
    assert device.poll(15.1) == b""
    assert device.feed(wire.REQUEST_TOPICS, 15.2) != b""


def test_stop_request_silences_the_board() -> None:
    device = VirtualRodney(tacho=True)
    device.feed(wire.REQUEST_TOPICS, 0.0)
    assert device.feed(wire.STOP_SENDING, 1.0) == b""
    assert device.poll(5.0) == b""


def test_servos_start_at_the_sketch_angles_and_turn_at_their_speed() -> None:
    device = VirtualRodney()
    assert [device.angle(index, 0.0) for index in range(4)] == list(ENCODER_SKETCH_STARTS)
    device.feed(command(0, 130), 1.0)
    assert device.angle(0, 1.05) == pytest.approx(90 + 0.05 * SERVO_SPEED)
    assert device.angle(0, 1.2) == 130
    assert device.commands == [(0, 130)]


@pytest.mark.parametrize(
    ("sent", "reached"), [(0, 0), (180, 180), (181, 180), (543, 180), (544, 0), (1472, 90), (2400, 180), (65535, 180)]
)
def test_servo_values_follow_the_servo_library(sent: int, reached: float) -> None:
    device = VirtualRodney()
    device.feed(command(2, sent), 0.0)
    assert device.angle(2, 1.0) == pytest.approx(reached)


def test_unknown_servo_is_logged_and_moves_nothing() -> None:
    device = VirtualRodney()
    device.feed(wire.REQUEST_TOPICS, 0.0)
    device.feed(command(4, 10), 0.1)
    (frame,) = wire.RosserialFrameFinder().feed(device.poll(0.2))
    assert wire.RosserialLog.unpack(frame.data) == wire.RosserialLog(0, "no servo 4")
    assert [device.angle(index, 1.0) for index in range(4)] == list(ENCODER_SKETCH_STARTS)


def test_slow_frame_is_dropped_and_the_next_is_accepted() -> None:
    device = VirtualRodney()
    device.feed(command(0, 10)[:6], 0.0)
    device.feed(command(0, 10)[6:], 0.021)
    assert device.commands == []
    device.feed(command(0, 20)[:6], 1.0)
    device.feed(command(0, 20)[6:], 1.019)
    assert device.commands == [(0, 20)]


def test_a_frame_larger_than_the_buffer_is_dropped() -> None:
    device = VirtualRodney(buffer=128)
    device.feed(wire.RosserialFrame(100, wire.ServoAngle(0, 10).pack() + bytes(126)).pack(), 0.0)
    device.feed(wire.RosserialFrame(100, wire.ServoAngle(0, 20).pack() + bytes(125)).pack(), 1.0)
    assert device.commands == [(0, 20)]


def test_a_wrong_checksum_and_a_short_message_move_nothing() -> None:
    device = VirtualRodney()
    device.feed(command(0, 10)[:-1] + b"\x00", 0.0)
    device.feed(wire.RosserialFrame(100, b"\x00\x0a").pack(), 1.0)
    assert device.commands == []
    assert device.angle(0, 2.0) == 90


def test_reset_board_boots_again_with_servos_at_their_start() -> None:
    device = VirtualRodney(boot_delay=1.0)
    device.poll(0.0)
    device.feed(wire.REQUEST_TOPICS + command(0, 10), 1.0)
    assert device.angle(0, 2.0) == 10
    device.reset(2.0)
    assert device.feed(wire.REQUEST_TOPICS, 2.5) == b""
    assert device.poll(3.0) == b""
    assert device.angle(0, 4.0) == 90
    assert device.poll(30.0) == b""


def test_malformed_header_is_answered_until_topics_are_requested() -> None:
    device = VirtualRodney()
    assert device.feed(b"\xff\x00" * 2, 1.0) == wire.REQUEST_TIME * 2
    device.feed(wire.REQUEST_TOPICS, 1.1)
    assert device.feed(b"\xff\x00" * 2, 1.2) == b""
    assert device.feed(b"\xff\x00", 12.2) == wire.REQUEST_TIME  # nobody has answered for long


def test_first_sketches_log_angles_and_obey_unconfigured() -> None:
    device = VirtualRodney(logs_angles=True, start_angles=UNSENT_SKETCH_ANGLES)
    (frame,) = wire.RosserialFrameFinder().feed(device.feed(command(1, 120), 0.0))
    assert wire.RosserialLog.unpack(frame.data) == wire.RosserialLog(0, "Servo 1 ")
    assert device.angle(1, 1.0) == 120
    assert device.max_step == pytest.approx(27.3)


def test_opening_the_port_resets_boards_without_native_usb() -> None:
    for keeps, opened in ((False, 90), (True, 10)):
        device = VirtualRodney(native_usb=keeps)
        device.feed(command(0, 10), 0.0)
        device.open_port(1.0)
        device.poll(1.0)
        assert device.angle(0, 2.0) == opened
        device.power_on(2.0)
        device.poll(2.0)
        assert device.angle(0, 3.0) == 90


class Powered:
    """A sketch with a clock of its own."""

    def __init__(self) -> None:
        self.device, self.now = VirtualRodney(boot_delay=1.0), 0.0


def test_random_events_take_every_transition_and_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    def let_time_pass(powered: Powered, chance: Random) -> None:
        powered.now += chance.choice((0.5, 1.5, 12.0))
        powered.device.poll(powered.now)

    def send(powered: Powered, chance: Random) -> None:
        powered.device.feed(chance.choice((wire.PROBE, wire.STOP_SENDING)), powered.now)

    def reset(powered: Powered, _: Random) -> None:
        powered.device.reset(powered.now)

    table = walk(monkeypatch, "drivers.arduino.virtual.TRANSITIONS", Powered, [let_time_pass, send, send, reset])
    assert table.visited == set(table)
    assert not table.missing
