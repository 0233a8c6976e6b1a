"""Protocol 1.0 as bytes, and the models' units: against published packets, and for any input."""

from itertools import pairwise
from math import radians

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivers.dynamixel import models as m
from drivers.dynamixel.wire import BROADCAST, Fault, Instruction, Packet, Parser, request, status

REQUESTS = [
    ("FF FF 01 02 01 FB", 1, Instruction.PING, ""),
    ("FF FF 01 04 02 2B 01 CC", 1, Instruction.READ, "2B 01"),
    ("FF FF 01 04 02 00 02 F6", 1, Instruction.READ, "00 02"),
    ("FF FF 01 04 02 24 08 CC", 1, Instruction.READ, "24 08"),
    ("FF FF 01 04 03 18 01 DE", 1, Instruction.WRITE, "18 01"),
    ("FF FF 01 05 03 1E 00 02 D6", 1, Instruction.WRITE, "1E 00 02"),
    ("FF FF 01 07 03 1E 00 02 64 00 70", 1, Instruction.WRITE, "1E 00 02 64 00"),
    ("FF FF FE 04 03 03 01 F6", BROADCAST, Instruction.WRITE, "03 01"),
    ("FF FF 01 05 04 1E F4 01 E2", 1, Instruction.REG_WRITE, "1E F4 01"),
    ("FF FF FE 02 05 FA", BROADCAST, Instruction.ACTION, ""),
    ("FF FF 00 02 06 F7", 0, Instruction.FACTORY_RESET, ""),
    (
        "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67",
        BROADCAST,
        Instruction.SYNC_WRITE,
        "1E 04 00 10 00 50 01 01 20 02 60 03",
    ),
    ("FF FF FE 09 92 00 02 01 1E 02 02 24 1D", BROADCAST, Instruction.BULK_READ, "00 02 01 1E 02 02 24"),
]
REPLIES = [
    ("FF FF 01 02 00 FC", Fault(0), ""),
    ("FF FF 01 03 00 20 DB", Fault(0), "20"),
    ("FF FF 01 04 00 0C 00 EE", Fault(0), "0C 00"),
    ("FF FF 01 0A 00 00 02 00 00 00 00 78 23 57", Fault(0), "00 02 00 00 00 00 78 23"),
    ("FF FF 01 02 20 DC", Fault.OVERLOAD, ""),
    ("FF FF 01 02 24 D8", Fault.OVERLOAD | Fault.OVERHEATING, ""),
]

packets = st.builds(Packet, id=st.integers(0, BROADCAST), code=st.integers(0, 255), parameters=st.binary(max_size=20))


def encoded(packet: Packet) -> bytes:
    return request(packet.id, packet.code, packet.parameters)


@pytest.mark.parametrize(("golden", "servo", "instruction", "parameters"), REQUESTS)
def test_a_published_request_is_built_and_understood(
    golden: str, servo: int, instruction: Instruction, parameters: str
) -> None:
    data = bytes.fromhex(parameters)
    assert request(servo, instruction, data) == bytes.fromhex(golden)
    assert Parser().feed(bytes.fromhex(golden)) == [Packet(servo, instruction, data)]


@pytest.mark.parametrize(("golden", "fault", "parameters"), REPLIES)
def test_a_published_reply_is_built_and_understood(golden: str, fault: Fault, parameters: str) -> None:
    data = bytes.fromhex(parameters)
    assert status(1, fault, data) == bytes.fromhex(golden)
    assert Parser().feed(bytes.fromhex(golden)) == [Packet(1, fault, data)]


def test_error_bits_have_names() -> None:
    assert Fault(0x24).words == "overheating, overload"
    assert Fault(0x7F).words == "voltage, angle limit, overheating, range, checksum, overload, instruction"
    assert not Fault(0).words


def test_a_packet_for_an_impossible_servo_or_of_impossible_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"0\.\.253 or 254 for all, not 255"):
        request(255, Instruction.PING)
    with pytest.raises(ValueError, match="253 parameters, not 254"):
        request(1, Instruction.WRITE, bytes(254))


def test_a_wrong_checksum_marks_the_packet_and_is_counted() -> None:
    parser = Parser()
    (packet,) = parser.feed(bytes.fromhex("FF FF 01 02 01 FA"))
    assert not packet.intact
    assert parser.broken == 1


def test_a_packet_that_was_cut_off_is_forgotten_on_reset() -> None:
    parser = Parser()
    assert parser.feed(bytes.fromhex("FF FF 01 04 02")) == []
    parser.reset()
    assert parser.feed(bytes.fromhex("FF FF 01 02 01 FB")) == [Packet(1, Instruction.PING)]
    assert parser.skipped == 5


@given(packets=st.lists(packets, max_size=5), cuts=st.lists(st.integers(0, 200), max_size=8))
def test_packets_are_found_wherever_the_stream_is_cut(packets: list[Packet], cuts: list[int]) -> None:
    stream = b"".join(encoded(packet) for packet in packets)
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    parser = Parser()
    found = [p for a, b in pairwise(edges) for p in parser.feed(stream[a:b])]
    assert found == packets
    assert parser.skipped == 0


@given(noise=st.binary(max_size=60).map(lambda data: data.replace(b"\xff", b"\x7f")), packet=packets)
def test_noise_before_a_packet_costs_only_itself(noise: bytes, packet: Packet) -> None:
    parser = Parser()
    assert parser.feed(noise + encoded(packet)) == [packet]
    assert parser.skipped == len(noise)


@given(noise=st.lists(st.sampled_from([0xFF, 0xFF, 0, 1, 2, 4, 0x1E]), max_size=30).map(bytes), packet=packets)
def test_even_false_headers_never_hide_a_packet_for_long(noise: bytes, packet: Packet) -> None:
    parser = Parser()
    # A false header may wait for up to 259 bytes; with so much sent after it, the truth comes out.
    whole = [p for p in parser.feed(noise + encoded(packet) + bytes(260)) if p.intact]
    assume(all(p == packet for p in whole))  # the noise was not by chance a packet of its own
    assert whole == [packet]


@given(data=st.binary(max_size=400), cut=st.integers(0, 400))
def test_any_bytes_are_digested_the_same_however_they_arrive(data: bytes, cut: int) -> None:
    at_once, in_two = Parser(), Parser()
    found = at_once.feed(data)
    assert in_two.feed(data[:cut]) + in_two.feed(data[cut:]) == found
    assert (in_two.skipped, in_two.broken) == (at_once.skipped, at_once.broken)
    for packet in found:
        if packet.intact:
            assert encoded(packet) in data


def test_the_ax12a_has_1024_ticks_over_300_degrees_around_512() -> None:
    model = m.MODELS["AX-12A"]
    assert model.number == 12
    assert model.tick == pytest.approx(0.00511327, abs=1e-8)
    assert model.angle(512) == 0
    assert model.angle(0) == pytest.approx(radians(-150))
    assert model.ticks(radians(29.297)) == 612
    assert model.ticks(9.0) == 1023
    assert model.ticks(-9.0) == 0
    assert model.speed_unit == pytest.approx(0.0116239, abs=1e-7)
    assert model.default(m.MODEL_NUMBER) == 12
    assert m.MODELS["AX-18A"].default(m.TEMPERATURE_LIMIT) == 75


@given(ticks=st.integers(0, 1023))
def test_ticks_survive_the_way_through_radians(ticks: int) -> None:
    model = m.MODELS["AX-12A"]
    assert model.ticks(model.angle(ticks)) == ticks


@given(angle=st.floats(radians(-150), radians(149.7)))
def test_an_angle_survives_the_way_through_ticks_within_half_a_tick(angle: float) -> None:
    model = m.MODELS["AX-12A"]
    assert model.angle(model.ticks(angle)) == pytest.approx(angle, abs=model.tick * 0.5001)


@given(speed=st.floats(0, 100))
def test_a_speed_is_never_0_ticks_which_would_mean_full_speed(speed: float) -> None:
    assert 1 <= m.MODELS["AX-12A"].speed_ticks(speed) <= 1023


@given(value=st.integers(-1023, 1023))
def test_a_signed_figure_survives_its_direction_bit(value: int) -> None:
    assert m.signed(m.unsigned(value)) == value


def test_baud_codes_name_the_usual_rates() -> None:
    codes = {1: 1_000_000, 3: 500_000, 4: 400_000, 7: 250_000, 9: 200_000, 16: 115_200, 34: 57_600, 207: 9600}
    assert {code: m.baud_of(code) for code in codes} == codes
    assert [m.baud_code(baud) for baud in codes.values()] == list(codes)


def test_registers_lie_side_by_side_without_overlap() -> None:
    registers = sorted(m.MODELS["AX-12A"].registers, key=lambda register: register.address)
    assert all(a.end <= b.address for a, b in pairwise(registers))
    assert all(r.lower <= r.default <= r.upper for r in registers if r.writable)
    assert registers[-1].end == 50
