"""Protocol 1.0 as bytes: against published packets, and for any input."""

from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.servos.wire import BROADCAST, Packet, PacketParser, Protocol1Instruction, ServoFault, request, status

REQUESTS = [
    ("FF FF 01 02 01 FB", 1, Protocol1Instruction.PING, ""),
    ("FF FF 01 04 02 2B 01 CC", 1, Protocol1Instruction.READ, "2B 01"),
    ("FF FF 01 04 02 00 02 F6", 1, Protocol1Instruction.READ, "00 02"),
    ("FF FF 01 04 02 24 08 CC", 1, Protocol1Instruction.READ, "24 08"),
    ("FF FF 01 04 03 18 01 DE", 1, Protocol1Instruction.WRITE, "18 01"),
    ("FF FF 01 05 03 1E 00 02 D6", 1, Protocol1Instruction.WRITE, "1E 00 02"),
    ("FF FF 01 07 03 1E 00 02 64 00 70", 1, Protocol1Instruction.WRITE, "1E 00 02 64 00"),
    ("FF FF 01 04 03 03 02 F2", 1, Protocol1Instruction.WRITE, "03 02"),
    ("FF FF FE 04 03 03 01 F6", BROADCAST, Protocol1Instruction.WRITE, "03 01"),
    ("FF FF 01 05 04 1E F4 01 E2", 1, Protocol1Instruction.REG_WRITE, "1E F4 01"),
    ("FF FF FE 02 05 FA", BROADCAST, Protocol1Instruction.ACTION, ""),
    ("FF FF 00 02 06 F7", 0, Protocol1Instruction.FACTORY_RESET, ""),
    (
        "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67",
        BROADCAST,
        Protocol1Instruction.SYNC_WRITE,
        "1E 04 00 10 00 50 01 01 20 02 60 03",
    ),
    ("FF FF FE 09 92 00 02 01 1E 02 02 24 1D", BROADCAST, Protocol1Instruction.BULK_READ, "00 02 01 1E 02 02 24"),
]
REPLIES = [
    ("FF FF 01 02 00 FC", ServoFault(0), ""),
    ("FF FF 01 03 00 20 DB", ServoFault(0), "20"),
    ("FF FF 01 04 00 0C 00 EE", ServoFault(0), "0C 00"),
    ("FF FF 01 0A 00 00 02 00 00 00 00 78 23 57", ServoFault(0), "00 02 00 00 00 00 78 23"),
    ("FF FF 01 02 20 DC", ServoFault.OVERLOAD, ""),
    ("FF FF 01 02 24 D8", ServoFault.OVERLOAD | ServoFault.OVERHEATING, ""),
]

packets = st.builds(Packet, id=st.integers(0, BROADCAST), code=st.integers(0, 255), parameters=st.binary(max_size=20))


def encoded(packet: Packet) -> bytes:
    return request(packet.id, packet.code, packet.parameters)


def flipped(packet: Packet, place: int, bit: int) -> bytes:
    """Return a packet with one bit wrong."""
    damaged = bytearray(encoded(packet))
    damaged[place % len(damaged)] ^= 1 << bit
    return bytes(damaged)


@pytest.mark.parametrize(("golden", "servo", "instruction", "parameters"), REQUESTS)
def test_a_published_request_is_built_and_understood(
    golden: str, servo: int, instruction: Protocol1Instruction, parameters: str
) -> None:
    data = bytes.fromhex(parameters)
    assert request(servo, instruction, data) == bytes.fromhex(golden)
    assert PacketParser().feed(bytes.fromhex(golden)) == [Packet(servo, instruction, data)]


@pytest.mark.parametrize(("golden", "fault", "parameters"), REPLIES)
def test_a_published_reply_is_built_and_understood(golden: str, fault: ServoFault, parameters: str) -> None:
    data = bytes.fromhex(parameters)
    assert status(1, fault, data) == bytes.fromhex(golden)
    assert PacketParser().feed(bytes.fromhex(golden)) == [Packet(1, fault, data)]


def test_error_bits_have_names() -> None:
    assert ServoFault(0x24).description == "overheating, overload"
    assert ServoFault(0x7F).description == "voltage, angle limit, overheating, range, checksum, overload, instruction"
    assert not ServoFault(0).description


def test_protocol_1_reply_drops_faults_unknown_to_the_protocol() -> None:
    assert status(1, ServoFault.OVERLOAD | ServoFault.SHOCK) == status(1, ServoFault.OVERLOAD)


def test_a_packet_for_an_impossible_servo_or_of_impossible_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"0\.\.253 or 254 for all, not 255"):
        request(255, Protocol1Instruction.PING)
    with pytest.raises(ValueError, match="253 parameters, not 254"):
        request(1, Protocol1Instruction.WRITE, bytes(254))


def test_a_wrong_checksum_marks_the_packet_and_is_counted() -> None:
    parser = PacketParser()
    (packet,) = parser.feed(bytes.fromhex("FF FF 01 02 01 FA"))
    assert not packet.intact
    assert parser.damaged_packets == 1


def test_reset_discards_a_partial_packet() -> None:
    parser = PacketParser()
    assert parser.feed(bytes.fromhex("FF FF 01 04 02")) == []
    parser.reset()
    assert parser.feed(bytes.fromhex("FF FF 01 02 01 FB")) == [Packet(1, Protocol1Instruction.PING)]
    assert parser.skipped_bytes == 5


def test_a_packet_of_protocol_2_is_none_of_protocol_1() -> None:
    parser = PacketParser()
    assert parser.feed(bytes.fromhex("FF FF FD 00 01 03 00 01 19 4E FF FF 01 02 01 FB")) == [Packet(1, 1)]
    assert parser.skipped_bytes == 10


@given(packets=st.lists(packets, max_size=5), cuts=st.lists(st.integers(0, 200), max_size=8))
def test_packets_are_found_wherever_the_stream_is_cut(packets: list[Packet], cuts: list[int]) -> None:
    stream = b"".join(encoded(packet) for packet in packets)
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    parser = PacketParser()
    found = [p for a, b in pairwise(edges) for p in parser.feed(stream[a:b])]
    assert found == packets
    assert parser.skipped_bytes == 0


@given(noise=st.binary(max_size=60).map(lambda data: data.replace(b"\xff", b"\x7f")), packet=packets)
def test_noise_before_a_packet_is_skipped(noise: bytes, packet: Packet) -> None:
    parser = PacketParser()
    assert parser.feed(noise + encoded(packet)) == [packet]
    assert parser.skipped_bytes == len(noise)


@given(noise=st.lists(st.sampled_from([0xFF, 0xFF, 0, 1, 2, 4, 0x1E]), max_size=30).map(bytes), packet=packets)
def test_even_false_headers_never_hide_a_packet_for_long(noise: bytes, packet: Packet) -> None:
    parser = PacketParser()
    # A false header may wait for up to 259 bytes; with so much sent after it, the truth comes out.
    whole = [p for p in parser.feed(noise + encoded(packet) + bytes(260)) if p.intact]
    assume(all(p == packet for p in whole))  # the noise was not by chance a packet of its own
    assert whole == [packet]


@given(packet=packets, place=st.integers(0, 10**6), bit=st.integers(0, 7))
def test_flipped_bit_never_makes_another_packet_of_the_same_length(packet: Packet, place: int, bit: int) -> None:
    sound = [p for p in PacketParser().feed(flipped(packet, place, bit) + bytes(260)) if p.intact]
    assert all(len(p.parameters) != len(packet.parameters) for p in sound)


@given(packet=packets, place=st.integers(0, 10**6), bit=st.integers(0, 7), more=st.lists(packets, min_size=2))
def test_after_a_flipped_bit_the_way_back_is_found(packet: Packet, place: int, bit: int, more: list[Packet]) -> None:
    stream = flipped(packet, place, bit) + b"".join(encoded(other) for other in more)
    sound = [p for p in PacketParser().feed(stream + bytes(260)) if p.intact]
    # A length that is wrong by 1 or 2 swallows that much of the next header, and the checksum is right. Any other wrong
    # length meets a right checksum by chance alone.
    assume(all(p in more or len(p.parameters) <= len(packet.parameters) + 2 for p in sound))
    assert sound[-1] == more[-1]


def test_a_length_wrong_by_one_or_two_can_make_a_longer_packet_together_with_the_next() -> None:
    reply, following = bytearray(status(1, 0, b"\x07\x00")), status(1, 0, b"\x09\x00")
    reply[3] ^= 1
    (false,) = PacketParser().feed(bytes(reply) + following)
    assert false.intact
    assert len(false.parameters) == 3  # so a reply of 3 bytes is no safe sign that this one is not meant


@given(data=st.binary(max_size=400), cut=st.integers(0, 400))
def test_parser_result_is_independent_of_chunking(data: bytes, cut: int) -> None:
    at_once, in_two = PacketParser(), PacketParser()
    found = at_once.feed(data)
    assert in_two.feed(data[:cut]) + in_two.feed(data[cut:]) == found
    assert (in_two.skipped_bytes, in_two.damaged_packets) == (at_once.skipped_bytes, at_once.damaged_packets)
    for packet in found:
        if packet.intact:
            assert encoded(packet) in data
