"""rosserial's bytes: as documented, cut anywhere, with noise between them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.arduino import wire

GOLDEN = [
    ("FF FE 03 00 FC 64 00 00 5A 00 41", 100, wire.ServoAngle(0, 90)),
    ("FF FE 03 00 FC 64 00 01 78 00 22", 100, wire.ServoAngle(1, 120)),
    ("FF FE 03 00 FC 64 00 00 B4 00 E7", 100, wire.ServoAngle(0, 180)),
    ("FF FE 03 00 FC 64 00 03 2C 01 6B", 100, wire.ServoAngle(3, 300)),
    ("FF FE 08 00 F7 7D 00 00 00 20 41 00 00 20 C1 40", 125, wire.Tacho(10.0, -10.0)),
    ("FF FE 08 00 F7 0A 00 00 F1 53 65 00 65 CD 1D FD", wire.TIME, wire.RosserialTime(1700000000.5)),
    ("FF FE 07 00 F8 07 00 01 02 00 00 00 68 69 24", wire.LOG, wire.RosserialLog(1, "hi")),
    (
        "FF FE 4D 00 B2 01 00 64 00 05 00 00 00"
        + b"servo".hex()
        + "16 00 00 00"
        + b"servo_msgs/servo_array".hex()
        + "20 00 00 00"
        + b"a817c864e9b57c7eb2ecd1a47fde1733".hex()
        + "00 02 00 00 DF",
        wire.SUBSCRIBER,
        wire.TopicInfo(100, wire.SERVO_TOPIC, 512),
    ),
]
Message = wire.ServoAngle | wire.Tacho | wire.RosserialTime | wire.RosserialLog | wire.TopicInfo

frames = st.builds(wire.RosserialFrame, st.integers(0, 0xFFFF), st.binary(max_size=40))


@pytest.mark.parametrize(("packet", "topic", "message"), GOLDEN)
def test_messages_pack_to_the_documented_bytes(packet: str, topic: int, message: Message) -> None:
    assert wire.RosserialFrame(topic, message.pack()).pack() == bytes.fromhex(packet)


@pytest.mark.parametrize(("packet", "topic", "message"), GOLDEN)
def test_the_documented_bytes_unpack_to_the_messages(packet: str, topic: int, message: Message) -> None:
    (frame,) = wire.RosserialFrameFinder().feed(bytes.fromhex(packet))
    assert frame.topic == topic
    assert type(message).unpack(frame.data) == message


def test_the_fixed_requests_are_the_documented_ones() -> None:
    assert bytes.fromhex("FF FE 00 00 FF 00 00 FF") == wire.REQUEST_TOPICS
    assert bytes.fromhex("FF FE 00 00 FF 0B 00 F4") == wire.STOP_SENDING
    assert bytes.fromhex("FF FE 08 00 F7 0A 00" + "00" * 8 + "F5") == wire.REQUEST_TIME


@given(st.lists(frames, max_size=6), st.data())
def test_frames_are_found_however_the_stream_is_cut(sent: list[wire.RosserialFrame], data: st.DataObject) -> None:
    stream = b"".join(frame.pack() for frame in sent)
    finder, found, at = wire.RosserialFrameFinder(), list[wire.RosserialFrame](), 0
    while at < len(stream):
        size = data.draw(st.integers(1, len(stream) - at))
        found += finder.feed(stream[at : at + size])
        at += size
    assert found == sent
    assert (finder.skipped, finder.checksum_errors, finder.has_partial_frame) == (0, 0, False)


@given(st.binary(max_size=60).filter(lambda noise: wire.HEADER not in noise), frames)
def test_noise_before_a_rosserial_frame_is_skipped(noise: bytes, frame: wire.RosserialFrame) -> None:
    finder = wire.RosserialFrameFinder()
    assert finder.feed(noise + frame.pack()) == [frame]
    assert finder.skipped == len(noise)


@given(st.binary(max_size=300))
def test_any_bytes_are_borne_and_counted(data: bytes) -> None:
    finder = wire.RosserialFrameFinder()
    found = finder.feed(data)
    while finder.has_partial_frame:
        found += finder.drop_partial_frame()
    assert finder.skipped + sum(len(frame.pack()) for frame in found) == len(data)


@given(frames, st.data())
def test_a_flipped_bit_is_never_taken_for_the_frame(frame: wire.RosserialFrame, data: st.DataObject) -> None:
    packet = bytearray(frame.pack())
    packet[data.draw(st.integers(0, len(packet) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    assert frame not in wire.RosserialFrameFinder().feed(bytes(packet))


def test_a_wrong_checksum_is_counted_and_the_next_frame_found() -> None:
    good = wire.RosserialFrame(100, b"abc").pack()
    for position in (4, len(good) - 1):  # that of the length, that of the data
        bad = bytearray(good)
        bad[position] ^= 0x10
        finder = wire.RosserialFrameFinder()
        assert finder.feed(bytes(bad) + good) == [wire.RosserialFrame(100, b"abc")]
        assert (finder.checksum_errors, finder.skipped) == (1, len(good))


def test_a_frame_longer_than_the_buffer_is_dropped() -> None:
    finder = wire.RosserialFrameFinder(max_data_length=8)
    assert finder.feed(wire.RosserialFrame(100, bytes(9)).pack() + wire.RosserialFrame(100, bytes(8)).pack()) == [
        wire.RosserialFrame(100, bytes(8))
    ]
    assert finder.skipped == 17


def test_a_frame_behind_a_false_header_comes_out_when_waiting_is_given_up() -> None:
    finder = wire.RosserialFrameFinder()
    assert finder.feed(bytes.fromhex("FF FE 20 00 DF") + wire.STOP_SENDING) == []
    assert finder.drop_partial_frame() == [wire.RosserialFrame(wire.STOP, b"")]
    assert finder.skipped == 5


@pytest.mark.parametrize("kind", [wire.ServoAngle, wire.Tacho, wire.RosserialTime, wire.RosserialLog, wire.TopicInfo])
def test_truncated_message_raises_value_error_with_its_bytes(kind: type[Message]) -> None:
    with pytest.raises(ValueError, match=r"ends too soon: 05"):
        kind.unpack(b"\x05")


def test_string_longer_than_its_message_raises_value_error() -> None:
    with pytest.raises(ValueError, match="a string of 9 bytes in a message of 7"):
        wire.RosserialLog.unpack(bytes.fromhex("01 09 00 00 00 68 69"))


@given(st.integers(0, 2**32 - 1), st.integers(0, 10**9 - 1))
def test_time_keeps_its_microseconds(whole: int, nanoseconds: int) -> None:
    time = wire.RosserialTime(whole + nanoseconds / 1e9)
    assert wire.RosserialTime.unpack(time.pack()).seconds % 2**32 == pytest.approx(time.seconds % 2**32, abs=1e-6)
