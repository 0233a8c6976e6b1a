"""The RPLIDAR's bytes: the published packets in both directions, and nodes in a stream with anything in it."""

from struct import error

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.rplidar import wire
from drivers.rplidar.nodes import MIN_NODES_IN_ROW, NODE_SIZE, STEPS_PER_TURN, NodeFinder, Nodes
from drivers.rplidar.wire import (
    RequestFinder,
    RPLidarCommand,
    RPLidarHealth,
    RPLidarInfo,
    RPLidarStatus,
    motor_request,
    request,
    unpack_pwm,
)

REQUESTS: list[tuple[bytes, str]] = [
    (request(RPLidarCommand.STOP), "A5 25"),
    (request(RPLidarCommand.RESET), "A5 40"),
    (request(RPLidarCommand.SCAN), "A5 20"),
    (request(RPLidarCommand.INFO), "A5 50"),
    (request(RPLidarCommand.HEALTH), "A5 52"),
    (request(0x82, bytes(5)), "A5 82 05 00 00 00 00 00 22"),
    (motor_request(660), "A5 F0 02 94 02 C1"),
    (motor_request(0), "A5 F0 02 00 00 57"),
    (wire.BOARD_REQUEST, "A5 FF 04 00 00 00 00 5E"),
    (request(0xA8, (600).to_bytes(2, "little")), "A5 A8 02 58 02 55"),
]

DESCRIPTORS: list[tuple[bytes, str]] = [
    (wire.SCAN_REPLY, "A5 5A 05 00 00 40 81"),
    (wire.INFO_REPLY, "A5 5A 14 00 00 00 04"),
    (wire.HEALTH_REPLY, "A5 5A 03 00 00 00 06"),
]

NODES = bytes.fromhex("3D 01 00 A0 0F  A2 41 2D A5 24  02 FF B3 00 00")


def some(count: int, *, distance: int = 4000, start: int = 0) -> Nodes:
    """Nodes as of one turn after another, 64 steps (a degree) apart."""
    angle = (64 * np.arange(start, start + count)) % STEPS_PER_TURN
    return Nodes(
        angle == 0,
        np.full(count, 15, dtype=np.uint8),
        angle.astype(np.uint16),
        np.full(count, distance, dtype=np.uint16),
    )


@pytest.mark.parametrize(("made", "published"), REQUESTS + DESCRIPTORS)
def test_requests_match_the_published_bytes(made: bytes, published: str) -> None:
    assert made == bytes.fromhex(published)


def test_published_nodes_round_trip() -> None:
    nodes = Nodes.unpack(np.frombuffer(NODES, dtype=np.uint8).reshape(-1, NODE_SIZE))
    assert nodes.new.tolist() == [True, False, False]
    assert nodes.quality.tolist() == [15, 40, 0]
    assert (nodes.angle / 64).tolist() == [0.0, 90.5, pytest.approx(359.98, abs=0.01)]
    assert (nodes.distance / 4).tolist() == [1000.0, 2345.25, 0.0]
    assert nodes.pack() == NODES


def test_numbers_of_the_replies_are_little_endian() -> None:
    assert RPLidarHealth.unpack(bytes.fromhex("02 34 12")) == RPLidarHealth(RPLidarStatus.ERROR, 0x1234)
    info = RPLidarInfo.unpack(bytes.fromhex("18 1D 01 07") + bytes(range(16)))
    assert (info.series, info.firmware_major, info.firmware_minor, info.hardware) == (1, 1, 29, 7)
    assert info.serial == bytes(range(16))
    assert RPLidarInfo.unpack(info.pack()) == info


@pytest.mark.parametrize("command", [RPLidarCommand.STOP, RPLidarCommand.SCAN])
def test_a_plain_command_takes_no_payload(command: RPLidarCommand) -> None:
    with pytest.raises(ValueError, match="takes no payload"):
        request(command, b"x")


def test_a_payload_is_at_most_255_bytes() -> None:
    with pytest.raises(ValueError, match="255 bytes at most, not 256"):
        request(RPLidarCommand.PWM, bytes(256))


def test_a_pulse_width_has_two_bytes() -> None:
    assert unpack_pwm(motor_request(660)[3:-1]) == 660
    with pytest.raises(error):
        unpack_pwm(b"x")


@given(st.data(), st.lists(st.binary(max_size=20), max_size=5))
def test_requests_are_found_however_the_stream_is_cut(data: st.DataObject, payloads: list[bytes]) -> None:
    stream = b"".join(request(RPLidarCommand.PWM, payload) + request(RPLidarCommand.STOP) for payload in payloads)
    finder, found = RequestFinder(), []
    while stream:
        size = data.draw(st.integers(1, len(stream)))
        found += finder.feed(stream[:size])
        stream = stream[size:]
    assert found == [each for p in payloads for each in ((RPLidarCommand.PWM, p), (RPLidarCommand.STOP, b""))]


def test_a_garbled_request_is_dropped_and_the_next_one_found() -> None:
    garbled = bytearray(motor_request(660))
    garbled[3] ^= 0x10
    assert RequestFinder().feed(b"noise" + garbled + request(RPLidarCommand.STOP)) == [(RPLidarCommand.STOP, b"")]


# --- nodes in a stream ------------------------------------------------------------------------------------------------


@given(st.data(), st.integers(MIN_NODES_IN_ROW, 60))
def test_nodes_are_found_however_the_stream_is_cut(data: st.DataObject, count: int) -> None:
    stream = some(count).pack()
    finder, packed = NodeFinder(), b""
    while stream:
        size = data.draw(st.integers(1, len(stream)))
        packed += finder.feed(stream[:size]).pack()
        stream = stream[size:]
    assert packed == some(count).pack()
    assert (finder.nodes, finder.resyncs, finder.skipped_bytes) == (count, 0, 0)


@given(st.integers(0, 40 * NODE_SIZE - 1), st.integers(1, 12))
def test_after_lost_bytes_all_but_a_few_nodes_are_real(where: int, lost: int) -> None:
    whole = some(80, distance=4001)
    stream = whole.pack()
    nodes = NodeFinder().feed(stream[:where] + stream[where + lost :])
    real = {whole.pack()[NODE_SIZE * i : NODE_SIZE * (i + 1)] for i in range(len(whole))}
    found = [nodes.pack()[NODE_SIZE * i : NODE_SIZE * (i + 1)] for i in range(len(nodes))]
    assert found[-20:] == [whole.pack()[NODE_SIZE * i : NODE_SIZE * (i + 1)] for i in range(60, 80)]
    assert sum(node not in real for node in found) <= MIN_NODES_IN_ROW


def test_node_with_wrong_check_bits_is_skipped_alone() -> None:
    stream = bytearray(some(40).pack())
    stream[10 * NODE_SIZE] ^= 0b01  # S and its opposite agree
    stream[20 * NODE_SIZE + 1] ^= 0b01  # the bit that is always 1
    finder = NodeFinder()
    nodes = finder.feed(bytes(stream))
    assert (nodes.angle // 64).tolist() == [angle for angle in range(40) if angle not in (10, 20)]
    assert finder.resyncs == 2
    assert finder.skipped_bytes == 2 * NODE_SIZE


def test_node_without_a_measurement_may_have_any_angle() -> None:
    nodes = some(40)
    nodes.distance[10], nodes.angle[10] = 0, 9999
    assert NodeFinder().feed(nodes.pack()).pack() == nodes.pack()


def test_a_leap_to_something_near_costs_no_node() -> None:
    nodes = some(40, start=30)
    nodes.angle[20:24] -= 20 * 64
    finder = NodeFinder()
    assert finder.feed(nodes.pack()).pack() == nodes.pack()
    assert finder.resyncs == 0


def test_node_finder_requires_a_row_of_nodes_to_synchronise() -> None:
    finder = NodeFinder()
    assert len(finder.feed(b"\x00" * 7 + some(MIN_NODES_IN_ROW).pack()[:-1])) == 0
    assert len(finder.feed(some(MIN_NODES_IN_ROW).pack()[-1:])) == MIN_NODES_IN_ROW


def test_restart_discards_a_partial_node() -> None:
    finder = NodeFinder()
    finder.feed(some(9).pack()[:-3])
    finder.restart()
    assert finder.feed(some(MIN_NODES_IN_ROW).pack()).pack() == some(MIN_NODES_IN_ROW).pack()
