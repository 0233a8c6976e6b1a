"""Protocol 2.0 as bytes: against published packets, and for any input."""

from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.servos.wire import BROADCAST, Packet, ServoFault
from drivers.servos.wire2 import (
    ALERT,
    LAST_ID,
    MAX_PARAMETERS,
    STATUS,
    PacketParser2,
    Protocol2Error,
    Protocol2Instruction,
    crc,
    decode_error,
    decode_hardware_error,
    request,
    status,
    stuff,
    unstuff,
)

REQUESTS = [
    ("01 03 00 01 19 4E", 1, Protocol2Instruction.PING, ""),
    ("FE 03 00 01 31 42", BROADCAST, Protocol2Instruction.PING, ""),
    ("01 07 00 02 84 00 04 00 1D 15", 1, Protocol2Instruction.READ, "84 00 04 00"),
    ("01 07 00 02 46 00 01 00 3C A3", 1, Protocol2Instruction.READ, "46 00 01 00"),
    ("01 09 00 03 74 00 00 02 00 00 CA 89", 1, Protocol2Instruction.WRITE, "74 00 00 02 00 00"),
    ("01 06 00 03 40 00 01 DB 66", 1, Protocol2Instruction.WRITE, "40 00 01"),
    ("01 0A 00 03 74 00 FF FF FD FD 00 21 E7", 1, Protocol2Instruction.WRITE, "74 00 FF FF FD 00"),
    ("01 09 00 04 68 00 C8 00 00 00 AE 8E", 1, Protocol2Instruction.REG_WRITE, "68 00 C8 00 00 00"),
    ("01 03 00 05 02 CE", 1, Protocol2Instruction.ACTION, ""),
    ("01 04 00 06 01 A1 E6", 1, Protocol2Instruction.FACTORY_RESET, "01"),
    ("01 03 00 08 2F 4E", 1, Protocol2Instruction.REBOOT, ""),
    ("01 08 00 10 01 44 58 4C 22 B1 DC", 1, Protocol2Instruction.CLEAR, "01 44 58 4C 22"),
    ("FE 09 00 82 84 00 04 00 01 02 CE FA", BROADCAST, Protocol2Instruction.SYNC_READ, "84 00 04 00 01 02"),
    (
        "FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
        BROADCAST,
        Protocol2Instruction.SYNC_WRITE,
        "74 00 04 00 01 96 00 00 00 02 AA 00 00 00",
    ),
    (
        "FE 0D 00 92 01 90 00 02 00 02 92 00 01 00 1A 05",
        BROADCAST,
        Protocol2Instruction.BULK_READ,
        "01 90 00 02 00 02 92 00 01 00",
    ),
]
REPLIES = [
    ("01 07 00 55 00 06 04 26 65 5D", 1, 0, "06 04 26"),
    ("01 07 00 55 00 24 04 2D F4 DF", 1, 0, "24 04 2D"),
    ("01 08 00 55 00 A6 00 00 00 8C C0", 1, 0, "A6 00 00 00"),
    ("01 04 00 55 00 A1 0C", 1, 0, ""),
    ("01 04 00 55 07 B0 8C", 1, Protocol2Error.ACCESS, ""),
    ("02 08 00 55 00 1F 08 00 00 BA BE", 2, 0, "1F 08 00 00"),
    ("01 05 00 55 80 20 99 21", 1, ALERT, "20"),
]

HEADER = "FF FF FD 00 "
ids = st.one_of(st.integers(0, LAST_ID), st.just(BROADCAST))
tricky = st.lists(st.sampled_from([0xFF, 0xFF, 0xFD, 0xFD, 0x00, 0x01, 0x55]), max_size=24).map(bytes)
packets = st.builds(
    Packet,
    id=ids,
    code=st.sampled_from([*Protocol2Instruction, STATUS]),
    parameters=st.one_of(st.binary(max_size=24), tricky),
)


def encoded(packet: Packet) -> bytes:
    return request(packet.id, packet.code, packet.parameters)


@pytest.mark.parametrize(("golden", "servo", "instruction", "parameters"), REQUESTS)
def test_a_published_request_is_built_and_understood(
    golden: str, servo: int, instruction: Protocol2Instruction, parameters: str
) -> None:
    frame, data = bytes.fromhex(HEADER + golden), bytes.fromhex(parameters)
    assert request(servo, instruction, data) == frame
    assert PacketParser2().feed(frame) == [Packet(servo, instruction, data)]


@pytest.mark.parametrize(("golden", "servo", "error", "parameters"), REPLIES)
def test_a_published_reply_is_built_and_understood(golden: str, servo: int, error: int, parameters: str) -> None:
    frame, data = bytes.fromhex(HEADER + golden), bytes.fromhex(parameters)
    assert status(servo, error, data) == frame
    assert PacketParser2().feed(frame) == [Packet(servo, STATUS, bytes((error,)) + data)]


def test_error_byte_is_decoded_into_faults() -> None:
    assert decode_error(0) == ServoFault(0)
    assert decode_error(Protocol2Error.ACCESS) == ServoFault.ACCESS
    assert decode_error(Protocol2Error.CRC) == ServoFault.CHECKSUM
    assert decode_error(ALERT) == ServoFault.ALERT
    assert decode_error(ALERT | Protocol2Error.LIMIT) == ServoFault.ALERT | ServoFault.LIMIT
    assert decode_error(Protocol2Error.FAILED) == decode_error(8) == decode_error(0x7F) == ServoFault.FAILED


def test_the_hardware_error_register_has_bits_with_names() -> None:
    assert decode_hardware_error(0b100000) == ServoFault.OVERLOAD
    assert decode_hardware_error(0b111101).description == "voltage, overheating, overload, encoder, shock"
    assert decode_hardware_error(0b11000010) == ServoFault(0)  # bits without a meaning


def test_crc_matches_the_published_packets() -> None:
    assert crc(bytes.fromhex("FF FF FD 00 01 03 00 01")) == 0x4E19
    assert crc(b"") == 0


def test_a_packet_for_an_impossible_servo_or_of_impossible_length_is_refused() -> None:
    for servo in (253, 255, -1):
        with pytest.raises(ValueError, match=r"0\.\.252 or 254 for all"):
            request(servo, Protocol2Instruction.PING)
    with pytest.raises(ValueError, match="1000 parameters, not 1001"):
        request(1, Protocol2Instruction.WRITE, bytes(MAX_PARAMETERS + 1))


def test_a_packet_as_long_as_can_be_is_understood_however_much_is_stuffed() -> None:
    data = b"\xff\xff\xfd" * (MAX_PARAMETERS // 3)
    assert PacketParser2().feed(request(1, Protocol2Instruction.WRITE, data)) == [
        Packet(1, Protocol2Instruction.WRITE, data)
    ]


def test_impossible_length_does_not_block_the_parser() -> None:
    false = bytes.fromhex("FF FF FD 00 01 FF FF 55")
    assert PacketParser2().feed(false + request(1, Protocol2Instruction.PING)) == [Packet(1, Protocol2Instruction.PING)]


def test_a_wrong_crc_marks_the_packet_and_is_counted() -> None:
    parser = PacketParser2()
    (packet,) = parser.feed(bytes.fromhex("FF FF FD 00 01 03 00 01 19 4F"))
    assert not packet.intact
    assert parser.damaged_packets == 1


def test_a_packet_of_protocol_1_is_none_of_protocol_2() -> None:
    parser = PacketParser2()
    assert parser.feed(bytes.fromhex("FF FF 01 04 02 24 08 CC FF FF FD 00 01 03 00 01 19 4E")) == [Packet(1, 1)]
    assert parser.skipped_bytes == 8


@given(data=st.one_of(st.binary(max_size=60), tricky))
def test_byte_stuffing_round_trips_without_a_header(data: bytes) -> None:
    assert unstuff(stuff(data)) == data
    assert b"\xff\xff\xfd\x00" not in stuff(data)


@given(packets=st.lists(packets, max_size=5), cuts=st.lists(st.integers(0, 200), max_size=8))
def test_packets_are_found_wherever_the_stream_is_cut(packets: list[Packet], cuts: list[int]) -> None:
    stream = b"".join(encoded(packet) for packet in packets)
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    parser = PacketParser2()
    found = [p for a, b in pairwise(edges) for p in parser.feed(stream[a:b])]
    assert found == packets
    assert parser.skipped_bytes == 0


@given(noise=st.one_of(st.binary(max_size=60), tricky), packet=packets)
def test_noise_before_a_packet_is_skipped(noise: bytes, packet: Packet) -> None:
    assume(b"\xff\xff\xfd\x00" not in noise + b"\xff\xff\xfd")
    parser = PacketParser2()
    assert parser.feed(noise + encoded(packet)) == [packet]
    assert parser.skipped_bytes == len(noise)


@given(noise=tricky, packet=packets)
def test_even_false_headers_never_hide_a_packet_for_long(noise: bytes, packet: Packet) -> None:
    # A false header may wait for the longest packet; with so much sent after it, the truth comes out.
    whole = [p for p in PacketParser2().feed(noise + encoded(packet) + bytes(1400)) if p.intact]
    assert whole == [packet]


@given(packet=packets, place=st.integers(0, 10**6), bit=st.integers(0, 7), more=st.lists(packets, max_size=2))
def test_flipped_bit_never_makes_another_packet(packet: Packet, place: int, bit: int, more: list[Packet]) -> None:
    damaged = bytearray(encoded(packet))
    damaged[place % len(damaged)] ^= 1 << bit
    assert not [p for p in PacketParser2().feed(bytes(damaged)) if p.intact]
    found = [p for p in PacketParser2().feed(bytes(damaged) + b"".join(map(encoded, more)) + bytes(1400)) if p.intact]
    assert found == more


@given(data=st.one_of(st.binary(max_size=400), tricky), cut=st.integers(0, 400))
def test_parser_result_is_independent_of_chunking(data: bytes, cut: int) -> None:
    at_once, in_two = PacketParser2(), PacketParser2()
    found = at_once.feed(data)
    assert in_two.feed(data[:cut]) + in_two.feed(data[cut:]) == found
    assert (in_two.skipped_bytes, in_two.damaged_packets) == (at_once.skipped_bytes, at_once.damaged_packets)
