"""What happens to replies on their way: as often as asked, and the same for the same seed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.servos.wire import Packet, PacketParser, Protocol1Instruction, request, status
from tests.drivers.chains import chain
from tests.drivers.fault_injection import MAX_DELAY, MAX_PAUSE, FaultInjection

REPLY = status(1, 0, bytes(range(11)))
MANY = 4000
KINDS = ("drop", "flip", "split", "noise", "late", "truncate")


def arranged(injection: FaultInjection) -> list[list[tuple[float, bytes]]]:
    return [injection.disturb(REPLY) for _ in range(MANY)]


def whole(pieces: list[tuple[float, bytes]]) -> bytes:
    return b"".join(data for _, data in pieces)


def test_reply_without_faults_is_unchanged() -> None:
    injection = FaultInjection()
    assert injection.disturb(REPLY) == [(0.0, REPLY)]
    assert not injection.echoes()
    assert not injection.happened


@pytest.mark.parametrize("kind", [*KINDS, "echo"])
def test_fault_rates_are_as_configured_and_counted(kind: str) -> None:
    injection = FaultInjection(seed=3, **{kind: 0.1})
    for _ in range(MANY):
        injection.disturb(REPLY)
        injection.echoes()
    assert set(injection.happened) == {kind}
    assert injection.happened[kind] == pytest.approx(0.1 * MANY, rel=0.2)


def test_each_fault_kind_disturbs_as_named() -> None:
    assert arranged(FaultInjection(drop=1)) == [[]] * MANY
    for pieces in arranged(FaultInjection(flip=1)):
        differing = int.from_bytes(whole(pieces)) ^ int.from_bytes(REPLY)
        assert differing.bit_count() == 1
    for pieces in arranged(FaultInjection(truncate=1)):
        assert 0 < len(whole(pieces)) < len(REPLY)
        assert REPLY.startswith(whole(pieces))
    for pieces in arranged(FaultInjection(noise=1)):
        assert len(REPLY) < len(whole(pieces)) <= len(REPLY) + 8
        assert whole(pieces).endswith(REPLY)
    for pieces in arranged(FaultInjection(split=1)):
        (first, _), (second, _) = pieces
        assert whole(pieces) == REPLY
        assert first == 0.0
        assert 0 <= second <= MAX_PAUSE
    for pieces in arranged(FaultInjection(late=1)):
        ((delay, data),) = pieces
        assert data == REPLY
        assert 0 <= delay <= MAX_DELAY


@given(seed=st.integers(0, 2**32), reply=st.binary(min_size=2, max_size=40))
def test_the_same_seed_makes_the_same_mishaps(seed: int, reply: bytes) -> None:
    one, other = (FaultInjection(seed=seed, **dict.fromkeys(KINDS, 0.5)) for _ in range(2))
    assert [one.disturb(reply) for _ in range(5)] == [other.disturb(reply) for _ in range(5)]


def test_chain_releases_each_fragment_when_due() -> None:
    bus = chain(1, injection=FaultInjection(seed=1, split=1, late=1))
    heard = bus.feed(request(1, Protocol1Instruction.PING), 10.0)
    times = []
    while (due := bus.next_poll_time()) is not None:
        times.append(due)
        heard += bus.poll(due)
    assert PacketParser().feed(heard) == [Packet(1, 0)]
    assert len(times) == 2
    assert 10.0 < times[0] < times[1] <= 10.0 + MAX_DELAY + MAX_PAUSE


def test_an_echo_comes_before_the_reply() -> None:
    bus = chain(1, injection=FaultInjection(echo=1))
    ping = request(1, Protocol1Instruction.PING)
    assert bus.feed(ping, 1.0) == ping + status(1)
