"""The vendor's packet code beside ours: the same bytes out, the same packets in, whatever the stream brings."""

from collections.abc import Sequence

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.servos import wire, wire2
from drivers.servos.codec import CODECS
from drivers.servos.sdk import SDK_CODECS
from drivers.servos.units import Protocol
from drivers.servos.wire import Packet

PROTOCOLS: Sequence[Protocol] = (1, 2)
SERVOS = st.integers(0, 252)
DATA = st.binary(max_size=60)
NO_STUFFING = DATA.filter(lambda data: b"\xff\xff\xfd" not in data and not data.startswith(b"\xff\xfd"))
ONE_REPLY = st.tuples(SERVOS, st.integers(0, 127), DATA)


def status(protocol: Protocol, servo: int, error: int, data: bytes) -> bytes:
    """Return the reply of a servo as our virtual ones send it."""
    return wire.status(servo, error, data) if protocol == 1 else wire2.status(servo, error, data)


def heard(protocol: Protocol, codecs: object, stream: bytes, cuts: Sequence[int] = ()) -> list[Packet]:
    """Return the sound packets in a stream that comes in pieces."""
    parser = (SDK_CODECS if codecs == "sdk" else CODECS)[protocol].parser()
    ends = sorted({*(cut % (len(stream) + 1) for cut in cuts), len(stream)})
    found = [packet for begin, end in zip([0, *ends], ends, strict=False) for packet in parser.feed(stream[begin:end])]
    return [packet for packet in found if packet.intact]


@pytest.mark.parametrize("protocol", PROTOCOLS)
@given(servo=SERVOS, instruction=st.sampled_from([1, 2, 3, 4, 5, 6, 8, 0x82, 0x83, 0x92]), data=NO_STUFFING)
def test_requests_are_the_same_bytes(protocol: Protocol, servo: int, instruction: int, data: bytes) -> None:
    ours, theirs = (codecs[protocol].frame(servo, instruction, data) for codecs in (CODECS, SDK_CODECS))
    assert theirs == ours


@pytest.mark.parametrize("protocol", PROTOCOLS)
@given(replies=st.lists(ONE_REPLY, max_size=5), cuts=st.lists(st.integers(0, 400), max_size=6))
@example(replies=[(1, 0, bytes.fromhex("ff ff fd 00 ff ff fd fd"))], cuts=[])
def test_fragmented_replies_are_parsed_alike(
    protocol: Protocol, replies: list[tuple[int, int, bytes]], cuts: list[int]
) -> None:
    stream = b"".join(status(protocol, *reply) for reply in replies)
    theirs = heard(protocol, "sdk", stream, cuts)
    assert theirs == heard(protocol, "own", stream)
    assert len(theirs) == len(replies)


@pytest.mark.parametrize("protocol", PROTOCOLS)
@given(noise=st.binary(max_size=30), reply=ONE_REPLY, flip=st.integers(0, 2**16))
def test_noise_and_bit_flips_never_create_another_packet(
    protocol: Protocol, noise: bytes, reply: tuple[int, int, bytes], flip: int
) -> None:
    frame = bytearray(status(protocol, *reply))
    frame[flip // 8 % len(frame)] ^= 1 << flip % 8
    parser = SDK_CODECS[protocol].parser()
    for packet in parser.feed(noise + bytes(frame)):
        assert not packet.intact or packet in heard(protocol, "own", noise + bytes(frame))
    parser.reset()
    assert [packet for packet in parser.feed(status(protocol, *reply)) if packet.intact] == heard(
        protocol, "own", status(protocol, *reply)
    )


def test_unescaped_header_in_the_vendor_code_is_refused() -> None:
    with pytest.raises(ValueError, match="ff ff fd in a packet; take framing: own"):
        SDK_CODECS[2].frame(1, wire2.Protocol2Instruction.WRITE, bytes.fromhex("74 00 ff ff fd 00"))


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_oversized_or_misaddressed_packet_is_refused(protocol: Protocol) -> None:
    for servo, size in ((1, 2000), (300, 0), (-1, 0)):
        with pytest.raises(ValueError, match="the vendor's code takes no packet"):
            SDK_CODECS[protocol].frame(servo, 3, bytes(size))


def test_too_short_reply_is_ignored() -> None:
    short = bytes.fromhex("ff ff 90 01 6e")  # its checksum is right, and it has no room for an error byte
    assert heard(1, "sdk", short + wire.status(7)) == heard(1, "own", short + wire.status(7)) == [Packet(7, 0)]
