"""A million random and mutated bytes into the Kobuki's parsers, beside a plain search that sees the stream whole."""

from random import Random

from drivers.kobuki.commands import COMMANDS
from drivers.kobuki.driver import KobukiProtocol
from drivers.kobuki.feedback import FEEDBACK
from drivers.kobuki.virtual import VirtualKobuki
from drivers.kobuki.wire import KobukiFrameFinder, decode, frame

MILLION = 1_000_000


def frames_of(stream: bytes) -> list[tuple[int, int]]:
    """Where the frames of a stream are, from and to: the first that checks, then the next behind it.

    Written by the protocol's own words, without the parser: ``AA 55 LEN payload CHK``, all behind AA 55 zero by XOR.
    """
    found, at = [], stream.find(b"\xaa\x55")
    while 0 <= at < len(stream) - 6:
        end = at + 3 + stream[at + 2] + 1
        total = 0
        for byte in stream[at + 2 : end]:
            total ^= byte
        if stream[at + 2] >= 3 and end <= len(stream) and total == 0:
            found.append((at, end))
            at = stream.find(b"\xaa\x55", end)
        else:
            at = stream.find(b"\xaa\x55", at + 1)
    return found


def reports(size: int) -> list[bytes]:
    """So many bytes of what a base tells that drives in circles; no two reports are alike."""
    kobuki, found, length = VirtualKobuki(), [], 0
    kobuki.poll(0.0)
    while length < size:
        now = kobuki.next_poll_time() or 0.0
        kobuki.body.command(0.3, 1.0, now)
        found.append(kobuki.poll(now))
        length += len(found[-1])
    return found


def mutated(whole: list[bytes], random: Random) -> tuple[bytes, list[tuple[int, int]]]:
    """Return a stream in which something has happened to every other frame, and where the others are."""
    stream, untouched = bytearray(), []
    for number, each in enumerate(whole):
        victim = bytearray(each)
        if number % 2:
            untouched.append((len(stream), len(stream) + len(victim)))
            stream += victim
            continue
        where = random.randrange(len(victim))
        match random.randrange(6):
            case 0:  # bits turn over
                for _ in range(random.randint(1, 4)):
                    victim[random.randrange(len(victim))] ^= 1 << random.randrange(8)
            case 1:  # bytes are lost
                del victim[where : where + random.randint(1, 40)]
            case 2:  # bytes come twice
                victim[where:where] = victim[where : where + random.randint(1, 40)]
            case 3:  # noise comes between, headers in it
                victim[where:where] = random.choice((b"", b"\xaa", b"\xaa\x55")) + random.randbytes(
                    random.randint(1, 40)
                )
            case 4:  # it is cut off
                del victim[where:]
            case _:  # the firmware talks nonsense, but frames it well
                victim = bytearray(frame(bytes(random.choices(victim[3:-1], k=random.randint(3, 255)))))
        stream += victim
    return bytes(stream), untouched


def fed(stream: bytes, random: Random) -> tuple[list[bytes], KobukiProtocol]:
    """Feed a stream, cut anywhere, to a finder and to the driver's ear; return the payloads, and the ear."""
    finder, listener, found, at = KobukiFrameFinder(), KobukiProtocol(), [], 0
    while at < len(stream):
        piece = stream[at : at + random.randint(1, 200)]
        at += len(piece)
        found += finder.feed(piece)
        listener.parse(piece, at * 1e-4)
    assert listener.counters()["frames"] == finder.frames == len(found)
    return found, listener


def test_a_million_random_bytes_raise_nothing_and_pass_only_with_their_checksum() -> None:
    random = Random(1)  # noqa: S311 - chance, not a secret
    # Pure noise holds a header in every 65 000 bytes; so most of it comes with one that leads nowhere.
    pieces = [random.choice((b"", b"\xaa\x55", b"\xaa\x55\x04")) + random.randbytes(40) for _ in range(MILLION // 41)]
    stream = b"".join(pieces)[:MILLION]
    found, _ = fed(stream, random)
    whole = [stream[start + 3 : end - 1] for start, end in frames_of(stream)]
    assert found == whole[: len(found)]
    assert len(whole) - len(found) <= 2  # the last are held back for what might still come
    assert len(found) > 20  # one in 256 has the right checksum by chance
    for payload in found:
        decode(payload, FEEDBACK)
        decode(payload, COMMANDS)


def test_in_a_million_mutated_bytes_every_untouched_report_is_found() -> None:
    random = Random(2)  # noqa: S311 - chance, not a secret
    whole = reports(MILLION)
    stream, untouched = mutated(whole, random)
    stream += bytes(300)  # so that nothing is held back
    found, listener = fed(stream, random)
    places = frames_of(stream)
    assert found == [stream[start + 3 : end - 1] for start, end in places]
    # What begins within a mutilated report, and checks by chance, may cover the one that follows.
    hit = set(places)
    missed = [place for place in untouched if place not in hit]
    for start, end in missed:
        assert any(other < start < other_end or other < end <= other_end for other, other_end in places)
    assert len(missed) < 0.005 * len(untouched)
    counters = listener.counters()
    assert (
        min(counters[name] for name in ("checksum_errors", "skipped_bytes", "unknown_parts", "malformed_parts")) > 100
    )
