"""Keys, tokens and attachments, byte for byte as the design document of `rmw_zenoh` has them; frames on a line."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from drivers.ros2 import wire
from drivers.ros2.publisher import MessageFilter
from drivers.ros2.wire import Attachment, Entity

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
ADD = "RIHS01_e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"

DESIGN = {
    "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener": Entity(
        "NN", 2, "aac3178e146ba6f1fc6e6a4085e77f21", "0", "0", "listener"
    ),
    f"@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_/{STRING}/"
    "::,10:,:,:,,": Entity(
        "MS",
        2,
        "aac3178e146ba6f1fc6e6a4085e77f21",
        "0",
        "10",
        "listener",
        "",
        "/chatter",
        "std_msgs/msg/String",
        STRING,
        "::,10:,:,:,,",
    ),
    f"@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/{STRING}/"
    "::,7:,:,:,,": Entity(
        "MP",
        2,
        "8b20917502ee955ac4476e0266340d5c",
        "0",
        "10",
        "talker",
        "",
        "/chatter",
        "std_msgs/msg/String",
        STRING,
        "::,7:,:,:,,",
    ),
    "@ros2_lv/2/f9980ee0495eaafb3e38f0d19e2eae12/0/10/SS/%/%/add_two_ints_server/%add_two_ints/"
    f"example_interfaces::srv::dds_::AddTwoInts_/{ADD}/::,10:,:,:,,": Entity(
        "SS",
        2,
        "f9980ee0495eaafb3e38f0d19e2eae12",
        "0",
        "10",
        "add_two_ints_server",
        "",
        "/add_two_ints",
        "example_interfaces/srv/AddTwoInts",
        ADD,
        "::,10:,:,:,,",
    ),
}
"""The tokens of the design document, and what they say."""


@pytest.mark.parametrize("token", DESIGN)
def test_tokens_of_the_design_document_are_parsed_and_written(token: str) -> None:
    assert wire.parse_entity(token) == DESIGN[token]
    assert DESIGN[token].token == token


def test_publisher_key_matches_the_design_document() -> None:
    talker = list(DESIGN.values())[2]
    assert talker.key == f"2/chatter/std_msgs::msg::dds_::String_/{STRING}"


def test_namespace_slashes_become_percent_signs_in_a_token() -> None:
    told = Entity(
        "MP", 0, "a", "1", "2", "talker", "/fleet/one", "/fleet/one/scan", "sensor_msgs/msg/LaserScan", "h", "q"
    )
    assert "/%fleet%one/talker/%fleet%one%scan/" in told.token
    assert wire.parse_entity(told.token) == told


def test_attachment_consists_of_number_time_and_gid() -> None:
    packed = Attachment(7, 1_700_000_000_000_000_001, bytes(range(16))).pack()
    assert packed == struct.pack("<qqB", 7, 1_700_000_000_000_000_001, 16) + bytes(range(16))
    assert len(packed) == 33
    assert wire.parse_attachment(packed) == Attachment(7, 1_700_000_000_000_000_001, bytes(range(16)))


@given(some.binary(max_size=90), some.booleans())
def test_invalid_attachment_is_none(data: bytes, named: bool) -> None:
    begun = b"\x0fsequence_number" * named + data
    told = wire.parse_attachment(begun)
    assert told is None or told.pack() == begun


@given(some.text(max_size=40))
@settings(max_examples=40)
def test_invalid_token_is_none(text: str) -> None:
    assert wire.parse_entity(text) is None
    wire.parse_entity("@ros2_lv/0/a/0/1/MP/%/%/n/" + text)


@given(some.lists(some.tuples(some.integers(0, 65535), some.binary(max_size=50)), max_size=6), some.integers(1, 9))
def test_frames_are_found_in_any_split(sent: list[tuple[int, bytes]], size: int) -> None:
    data = b"".join(wire.frame(*each) for each in sent)
    finder = wire.TopicFrameFinder()
    pieces = [data[at : at + size] for at in range(0, len(data), size)]
    assert [frame for piece in pieces for frame in finder.feed(piece)] == sent


@given(some.binary(max_size=200))
def test_frame_finder_accepts_any_bytes(data: bytes) -> None:
    finder = wire.TopicFrameFinder()
    finder.feed(data)
    finder.feed(data)


def test_relative_topic_is_within_the_namespace() -> None:
    assert wire.full_name("scan", "/tb4") == "/tb4/scan"
    assert wire.full_name("scan") == "/scan"
    assert wire.full_name("/scan", "/tb4") == "/scan"


@pytest.mark.parametrize("name", ["/cmd*", "**", "/tb4/$*/odom", "a b", "", "/", "/odom/", "/a//b", "odom?x", "/döck"])
def test_topic_name_with_wildcards_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="is not a valid topic name"):
        wire.full_name(name, "/tb4")


GID = bytes(16)


def test_duplicate_or_reordered_message_counts_once() -> None:
    sieve = MessageFilter()
    passed = [
        number for number in (1, 2, 2, 4, 3, 5) if sieve.accepts(Attachment(number, number * 10**8, GID), number / 10)
    ]
    assert passed == [1, 2, 4, 5]
    assert sieve.duplicate_count == 2


def test_delayed_messages_are_dropped_and_later_ones_accepted() -> None:
    sieve = MessageFilter()
    for number in range(20):
        assert sieve.accepts(Attachment(number, number * 10**8, GID), number / 10 + 0.01)
    held = [sieve.accepts(Attachment(number, number * 10**8, GID), 6.0) for number in range(20, 50)]
    assert not any(held)
    assert sieve.late_count == 30
    assert sieve.accepts(Attachment(60, 60 * 10**8, GID), 6.02)


def test_sender_whose_clock_was_set_back_is_accepted_after_a_second() -> None:
    sieve = MessageFilter()
    sieve.accepts(Attachment(1, 100 * 10**9, GID), 1.0)
    heard = [sieve.accepts(Attachment(2 + step, 50 * 10**9 + step * 10**8, GID), 1.1 + step / 10) for step in range(20)]
    assert heard.index(True) == 10
    assert all(heard[10:])


def test_each_sender_has_its_own_numbers() -> None:
    sieve = MessageFilter()
    assert sieve.accepts(Attachment(900, 10**9, GID), 1.0)
    assert sieve.accepts(Attachment(1, 10**9, b"x" * 16), 1.0)


def test_slow_sender_clock_makes_no_message_late() -> None:
    sieve = MessageFilter()
    for number in range(20_000):
        assert sieve.accepts(Attachment(number, round(number * 0.99995 * 10**9), GID), float(number))
