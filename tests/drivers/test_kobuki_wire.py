"""The Kobuki's bytes: the published packets in both directions, and a stream with anything in it."""

from fractions import Fraction
from math import pi, trunc
from struct import error

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.kobuki.commands import (
    COMMANDS,
    OUTPUTS_AT_START,
    BaseControl,
    Extra,
    GetGains,
    KobukiOutput,
    KobukiSound,
    KobukiTune,
    RequestExtra,
    SetGains,
    SetOutputs,
    SoundSequence,
)
from drivers.kobuki.feedback import (
    FEEDBACK,
    CliffDistance,
    Core,
    DockInfrared,
    FirmwareVersion,
    HardwareVersion,
    Inertia,
    Inputs,
    KobukiGains,
    MotorCurrent,
    RawGyro,
    UniqueId,
)
from drivers.kobuki.wire import HEADER, KobukiFrameFinder, KobukiSubpayload, decode, encode, frame, subpayload
from tests.cases import each

COMMAND_PACKETS: list[tuple[KobukiSubpayload, str]] = [
    (BaseControl.of(0.0, 0.0), "AA 55 06 01 04 00 00 00 00 03"),
    (BaseControl.of(0.1, 0.0), "AA 55 06 01 04 64 00 00 00 67"),
    (BaseControl.of(-0.1, 0.0), "AA 55 06 01 04 9C FF 00 00 60"),
    (BaseControl.of(0.0, 1.0), "AA 55 06 01 04 73 00 01 00 71"),
    (BaseControl.of(0.0, -1.0), "AA 55 06 01 04 8D FF 01 00 70"),
    (BaseControl.of(0.2, 0.5), "AA 55 06 01 04 01 01 90 01 92"),
    (BaseControl.of(0.2, -0.5), "AA 55 06 01 04 01 01 70 FE 8D"),
    (BaseControl.of(-0.1, 0.5), "AA 55 06 01 04 63 FF 38 FF 58"),
    (RequestExtra(Extra.HARDWARE | Extra.FIRMWARE | Extra.UNIQUE_ID), "AA 55 04 09 02 0B 00 04"),
    (SetOutputs(OUTPUTS_AT_START), "AA 55 04 0C 02 F0 00 FA"),
    (SetOutputs(OUTPUTS_AT_START | KobukiOutput.LED1_GREEN), "AA 55 04 0C 02 F0 02 F8"),
    (SoundSequence(KobukiTune.ON), "AA 55 03 04 01 00 06"),
    (KobukiSound.of(440, 0.1), "AA 55 05 03 03 3A 03 64 58"),
    (SetGains(1, 100_000, 100, 2000), "AA 55 0F 0D 0D 01 A0 86 01 00 64 00 00 00 D0 07 00 00 9A"),
    (GetGains(), "AA 55 03 0E 01 00 0C"),
]

FEEDBACK_PACKETS: list[tuple[tuple[KobukiSubpayload, ...], str]] = [
    (
        (Core(time_ms=1234, left_encoder=100, right_encoder=200, charger=2, battery_decivolts=160),),
        "AA 55 11 01 0F D2 04 00 00 00 64 00 C8 00 00 00 00 02 A0 00 C7",
    ),
    (
        (
            Core(
                time_ms=1000,
                bumper=2,
                cliff=1,
                left_encoder=-6 & 0xFFFF,
                right_encoder=5,
                left_pwm=20,
                right_pwm=20,
                buttons=1,
                charger=6,
                battery_decivolts=155,
            ),
        ),
        "AA 55 11 01 0F E8 03 02 00 01 FA FF 05 00 14 14 01 06 9B 00 6B",
    ),
    (
        (HardwareVersion(patch=0, minor=0, major=1), FirmwareVersion(patch=4, minor=1, major=1)),
        "AA 55 0C 0A 04 00 00 01 00 0B 04 04 01 01 00 08",
    ),
    ((DockInfrared(right=1, centre=2, left=16),), "AA 55 05 03 03 01 02 10 16"),
    ((Inertia(heading_cdeg=4500, rate_cdeg=-100),), "AA 55 09 04 07 94 11 9C FF 00 00 00 EC"),
    ((RawGyro(7, ((1, 2, 3), (4, 5, 6))),), "AA 55 10 0D 0E 07 06 01 00 02 00 03 00 04 00 05 00 06 00 15"),
]

WORDS = st.integers(0, 0xFFFF)
SHORTS = st.integers(-0x8000, 0x7FFF)
LONGS = st.integers(0, 0xFFFFFFFF)
BYTES = st.integers(0, 0xFF)
ANY_PART: st.SearchStrategy[KobukiSubpayload] = st.one_of(
    st.builds(
        Core, time_ms=WORDS, bumper=BYTES, left_encoder=WORDS, right_encoder=WORDS, left_pwm=st.integers(-128, 127)
    ),
    st.builds(DockInfrared, BYTES, BYTES, BYTES),
    st.builds(Inertia, SHORTS, SHORTS),
    st.builds(CliffDistance, WORDS, WORDS, WORDS),
    st.builds(MotorCurrent, BYTES, BYTES),
    st.builds(HardwareVersion, BYTES, BYTES, BYTES),
    st.builds(FirmwareVersion, BYTES, BYTES, BYTES),
    st.builds(RawGyro, BYTES, st.lists(st.tuples(SHORTS, SHORTS, SHORTS), max_size=3).map(tuple)),
    st.builds(Inputs, WORDS, WORDS, WORDS, WORDS, WORDS),
    st.builds(UniqueId, LONGS, LONGS, LONGS),
    st.builds(KobukiGains, BYTES, LONGS, LONGS, LONGS),
)


@each(("command", "packet"), COMMAND_PACKETS)
def test_a_command_is_the_published_packet_in_both_directions(command: KobukiSubpayload, packet: str) -> None:
    raw = bytes.fromhex(packet)
    assert encode(command) == raw
    (payload,) = KobukiFrameFinder().feed(raw)
    assert decode(payload, COMMANDS).parts == (command,)


@each(("parts", "packet"), FEEDBACK_PACKETS)
def test_feedback_is_the_published_packet_in_both_directions(parts: tuple[KobukiSubpayload, ...], packet: str) -> None:
    raw = bytes.fromhex(packet)
    assert encode(*parts) == raw
    (payload,) = KobukiFrameFinder().feed(raw)
    assert decode(payload, FEEDBACK).parts == parts


def test_a_usual_report_has_81_or_87_bytes() -> None:
    usual = (Core(), DockInfrared(), Inertia(), CliffDistance(), MotorCurrent(), Inputs())
    sample = (0, 0, 0)
    assert len(encode(*usual, RawGyro(0, (sample,) * 2))) == 81
    assert len(encode(*usual, RawGyro(0, (sample,) * 3))) == 87


@given(st.lists(ANY_PART, min_size=1, max_size=7))
def test_subpayloads_round_trip(parts: list[KobukiSubpayload]) -> None:
    (payload,) = KobukiFrameFinder().feed(encode(*parts))
    decoded = decode(payload, FEEDBACK)
    assert decoded.parts == tuple(parts)
    assert (decoded.unknown, decoded.malformed) == (0, 0)


@each(("number", "version"), [(123, "1.0.0"), (110, "1.1.0"), (10100, "1.1.0"), (111, "1.1.1"), (10101, "1.1.1")])
def test_old_firmware_version_has_two_bytes(number: int, version: str) -> None:
    payload = subpayload(FirmwareVersion.ID, number.to_bytes(2, "little"))
    (part,) = decode(payload, FEEDBACK).parts
    assert isinstance(part, FirmwareVersion)
    assert str(part) == version


def test_unknown_two_byte_version_is_malformed() -> None:
    decoded = decode(subpayload(FirmwareVersion.ID, b"\x99\x00"), FEEDBACK)
    assert (decoded.parts, decoded.malformed) == ((), 1)


def test_raw_gyro_is_turned_into_the_axes_of_the_robot() -> None:
    ((x, y, z),) = RawGyro(0, ((1000, 2000, 3000),)).rates
    assert (x, y, z) == pytest.approx((-2 * 8.75 * pi / 180, 8.75 * pi / 180, 3 * 8.75 * pi / 180))


@given(st.floats(-0.7, 0.7), st.floats(-pi, pi))
def test_base_control_keeps_the_velocity_within_tolerance(linear: float, angular: float) -> None:
    understood, turning = BaseControl.of(linear, angular).velocity
    # A millimetre is cut off the speed and off the radius; a circle of under 2 mm is a turn on the spot.
    assert turning == pytest.approx(angular, abs=0.025 + 0.02 * abs(angular))
    assert understood == pytest.approx(linear, abs=0.011)


def documented(linear: float, angular: float) -> tuple[Fraction, Fraction]:
    """The vendor's rule in exact numbers, before it is cut to whole millimetres: the speed, and the radius.

    On a circle the speed is that of the wheel that is further out, which is the right one when the centre is on the
    left; each wheel is half of 230 mm from the middle.
    """
    v, w = 1000 * Fraction(linear), Fraction(angular)
    left, right = v - 115 * w, v + 115 * w
    if abs(w) < Fraction(1, 10_000):
        return v, Fraction(0)
    if abs(v) < Fraction(1, 10) or abs(v) <= abs(w):  # slower than 0.1 mm/s, or a radius of 1 mm at most
        return (right - left) / 2, Fraction(1)
    return (right if v * w > 0 else left), v / w


def cut(value: Fraction) -> set[int]:
    """What a value of floating point may become: cut off towards zero, and clipped to 16 bits."""
    off = Fraction(1, 10**12)
    return {max(-0x8000, min(trunc(value * share), 0x7FFF)) for share in (1 - off, 1 + off)}


EDGES = (0.0, 1e-5, 9.9e-5, 1.01e-4, 4.95e-4, 5.05e-4, 1.98e-3, 2.02e-3)
"""Around what counts as nothing (0.0001), and around a radius of 1 mm with a turn of 0.5 or 2 rad/s."""

SPEEDS = sorted({sign * speed for sign in (-1, 1) for speed in (*EDGES, *(step / 20 for step in range(1, 15)), 40.0)})
TURNS = sorted({sign * turn for sign in (-1, 1) for turn in (*EDGES, *(step / 10 for step in range(1, 33)), 300.0)})


@each("linear", SPEEDS)
def test_speed_and_radius_follow_the_documented_rule(linear: float) -> None:
    for angular in TURNS:
        command = BaseControl.of(linear, angular)
        speed, radius = documented(linear, angular)
        assert command.speed_mm in cut(speed), (linear, angular)
        assert command.radius_mm in cut(radius), (linear, angular)
        (payload,) = KobukiFrameFinder().feed(encode(command))
        assert decode(payload, COMMANDS).parts == (command,)


@each(("linear", "angular", "speed"), [(0.0005, 0.5, 57), (-0.0005, 0.5, 57), (0.002, -2.0, -230)])
def test_a_radius_of_one_millimetre_is_a_turn_on_the_spot(linear: float, angular: float, speed: int) -> None:
    assert BaseControl.of(linear, angular) == BaseControl(speed, 1)


def test_too_wide_radius_is_clipped_at_the_same_speed() -> None:
    command = BaseControl.of(0.5, 0.0002)
    assert (command.speed_mm, command.radius_mm) == (500, 0x7FFF)


@each("velocity", [(1e9, 0.0), (-1e9, 0.0), (0.0, 1e9), (1e9, -1e9)])
def test_extreme_velocity_fits_its_bytes(velocity: tuple[float, float]) -> None:
    assert len(encode(BaseControl.of(*velocity))) == 10


def test_unknown_subpayload_does_not_spoil_the_others() -> None:
    payload = subpayload(0x63, b"\x01\x02\x03") + subpayload(Inertia.ID, Inertia(100, 5).pack())
    decoded = decode(payload, FEEDBACK)
    assert decoded.parts == (Inertia(100, 5),)
    assert (decoded.unknown, decoded.malformed) == (1, 0)


@each("kind", [Core(), Inertia(), RawGyro(0, ((1, 2, 3),)), UniqueId(1, 2, 3)])
def test_wrongly_sized_subpayload_does_not_spoil_the_others(kind: KobukiSubpayload) -> None:
    good = subpayload(DockInfrared.ID, DockInfrared(1, 2, 3).pack())
    for data in (kind.pack()[:-1], kind.pack() + b"\x00", b""):
        decoded = decode(good + subpayload(kind.ID, data) + good, FEEDBACK)
        assert decoded.parts == (DockInfrared(1, 2, 3),) * 2
        assert decoded.malformed == 1


@each("tail", [b"\x04", b"\x04\x07", b"\x04\x07\x01\x02", b"\x04\xff\x01"])
def test_truncated_subpayload_does_not_spoil_those_before(tail: bytes) -> None:
    decoded = decode(subpayload(DockInfrared.ID, b"\x01\x02\x03") + tail, FEEDBACK)
    assert decoded.parts == (DockInfrared(1, 2, 3),)
    assert decoded.malformed == 1


@given(st.binary(max_size=255))
def test_any_payload_can_be_read_without_an_exception(payload: bytes) -> None:
    decode(payload, FEEDBACK)
    decode(payload, COMMANDS)


def test_oversized_values_are_refused() -> None:
    with pytest.raises(error):
        encode(SetOutputs(0x10000))
    with pytest.raises(ValueError, match="3 to 255 bytes, not 0"):
        frame(b"")
    with pytest.raises(ValueError, match="not 256"):
        frame(bytes(256))


def test_bytes_may_come_one_at_a_time() -> None:
    raw = encode(Inertia(1, 2)) + encode(DockInfrared(1, 2, 3))
    finder = KobukiFrameFinder()
    payloads = [payload for byte in raw for payload in finder.feed(bytes([byte]))]
    assert [decode(payload, FEEDBACK).parts for payload in payloads] == [(Inertia(1, 2),), (DockInfrared(1, 2, 3),)]
    assert (finder.frames, finder.checksum_errors, finder.skipped_bytes) == (2, 0, 0)


def test_noise_before_a_header_is_skipped_and_counted() -> None:
    finder = KobukiFrameFinder()
    assert len(finder.feed(b"\x00\xaa\xaa" + encode(GetGains()))) == 1
    assert (finder.frames, finder.checksum_errors, finder.skipped_bytes) == (1, 0, 3)


def test_a_flipped_bit_costs_one_frame_and_no_more() -> None:
    whole = encode(Inertia(4500, -100))
    broken = bytearray(whole)
    broken[6] ^= 0x10
    finder = KobukiFrameFinder()
    assert len(finder.feed(whole + broken + whole)) == 2
    assert (finder.frames, finder.checksum_errors, finder.skipped_bytes) == (2, 1, len(whole))


def test_a_length_too_small_for_a_part_is_no_header() -> None:
    finder = KobukiFrameFinder()
    assert len(finder.feed(HEADER + b"\x02\x01\x00" + encode(GetGains()))) == 1
    assert finder.skipped_bytes == 5


def test_a_frame_inside_a_false_one_is_found() -> None:
    finder = KobukiFrameFinder()
    assert finder.feed(HEADER + b"\xfe" + encode(GetGains())) == []
    assert finder.feed(bytes(255)) == [encode(GetGains())[3:-1]]
    assert finder.checksum_errors == 1


def test_a_frame_half_arrived_is_forgotten_on_request() -> None:
    raw = encode(GetGains())
    finder = KobukiFrameFinder()
    finder.feed(raw[:4])
    finder.clear()
    assert finder.feed(raw[4:]) == []
    assert len(finder.feed(raw)) == 1


@st.composite
def noisy_streams(draw: st.DrawFn) -> tuple[bytes, list[bytes]]:
    """Frames with noise between them that holds no header, and the payloads of those frames."""
    stream, payloads = b"", []
    for _ in range(draw(st.integers(1, 6))):
        noise = draw(st.binary(max_size=40)).replace(b"\xaa", b"\x55")
        payload = draw(st.binary(min_size=3, max_size=255))
        stream += noise + frame(payload)
        payloads.append(payload)
    return stream, payloads


@given(noisy_streams(), st.lists(st.integers(1, 300), max_size=20))
def test_frames_between_noise_are_found_for_any_chunking(stream: tuple[bytes, list[bytes]], cuts: list[int]) -> None:
    raw, payloads = stream
    finder = KobukiFrameFinder()
    found, at = [], 0
    for cut in [*cuts, len(raw)]:
        found += finder.feed(raw[at : at + cut])
        at += cut
    assert found == payloads
    assert finder.checksum_errors == 0
    assert finder.frames == len(payloads)
    assert finder.skipped_bytes == len(raw) - sum(len(frame(payload)) for payload in payloads)


HEADERISH = st.lists(st.one_of(st.just(HEADER), st.binary(max_size=8)), max_size=40).map(b"".join)


@given(HEADERISH, st.lists(st.integers(1, 50), max_size=10))
def test_no_noise_breaks_the_finder_nor_passes_a_wrong_checksum(noise: bytes, cuts: list[int]) -> None:
    finder = KobukiFrameFinder()
    found, at = [], 0
    for cut in [*cuts, len(noise)]:
        found += finder.feed(noise[at : at + cut])
        at += cut
    for payload in found:
        assert frame(payload) in noise
    # After the worst noise, frames are found again as soon as the longest false header is used up.
    call = encode(GetGains())
    later = [payload for _ in range(60) for payload in finder.feed(call)]
    assert later[-1] == call[3:-1]
    assert len(later) >= 60 - 2 * (259 // len(call) + 1)


@given(st.binary(min_size=3, max_size=60), st.one_of(st.just(0), BYTES))
def test_only_the_right_checksum_makes_a_frame(payload: bytes, flipped: int) -> None:
    raw = bytearray(frame(payload))
    raw[-1] ^= flipped
    found = KobukiFrameFinder().feed(bytes(raw))
    if flipped == 0:
        assert found == [payload]
    else:  # at most what happens to be a frame within
        assert all(frame(inner) in raw[len(HEADER) :] for inner in found)
