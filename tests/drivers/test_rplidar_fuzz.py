"""A million random and mutated bytes into the RPLIDAR's parsers."""

from random import Random

import numpy as np

from drivers.base.scan_mounting import Mounting
from drivers.rplidar.make import ScanAssembler
from drivers.rplidar.models import MODELS
from drivers.rplidar.nodes import NODE_SIZE, STEPS_PER_TURN, NodeFinder, Nodes
from drivers.rplidar.wire import RequestFinder

MILLION = 1_000_000
MARK = 41
"""The quality of all real nodes: so a real node is known by its own bytes."""


def cut(stream: bytes, random: Random) -> list[bytes]:
    pieces, at = [], 0
    while at < len(stream):
        size = random.randint(1, 400)
        pieces.append(stream[at : at + size])
        at += size
    return pieces


def contained(found: Nodes, stream: bytes) -> bool:
    """Whether all of the nodes stand in the stream, in this order and one behind another.

    A node is packed with the right check bits: so those that stand there have them.
    """
    packed, at = found.pack(), 0
    for start in range(0, len(packed), NODE_SIZE):
        at = stream.find(packed[start : start + NODE_SIZE], at)
        if at < 0:
            return False
        at += NODE_SIZE
    return True


def joined(parts: list[Nodes]) -> Nodes:
    return Nodes(
        np.concatenate([part.new for part in parts]),
        np.concatenate([part.quality for part in parts]),
        np.concatenate([part.angle for part in parts]),
        np.concatenate([part.distance for part in parts]),
    )


def test_a_million_random_bytes_raise_nothing_and_pass_only_with_their_check_bits() -> None:
    random = Random(1)  # noqa: S311 - chance, not a secret
    stream = random.randbytes(MILLION)
    finder, turns, parts = NodeFinder(), ScanAssembler(MODELS["a1"], Mounting()), []
    for piece in cut(stream, random):
        parts.append(finder.feed(piece))
        turns.add(parts[-1], 0.0)
    found = joined(parts)
    assert contained(found, stream)
    assert finder.nodes < 400  # a row of nodes is rare in noise
    assert finder.nodes * NODE_SIZE + finder.skipped_bytes > MILLION - 100


def test_in_a_million_mutated_bytes_the_untouched_nodes_are_found() -> None:
    random = Random(2)  # noqa: S311 - chance, not a secret
    count = MILLION // NODE_SIZE
    chance = np.random.default_rng(3)
    angle = (64 * np.arange(count)) % STEPS_PER_TURN
    real = Nodes(
        angle == 0,
        np.full(count, MARK, dtype=np.uint8),
        angle.astype(np.uint16),
        chance.integers(600, 48000, count).astype(np.uint16),
    )
    stream, untouched = mutated(real.pack(), random)
    finder = NodeFinder()
    found = joined([finder.feed(piece) for piece in cut(stream, random)])
    assert contained(found, stream)
    packed = found.pack()
    seen = {packed[i : i + NODE_SIZE] for i in range(0, len(packed), NODE_SIZE)}
    missed = sum(node not in seen for node in untouched)
    assert len(untouched) > 0.8 * count
    assert missed < 0.01 * len(untouched)
    assert np.count_nonzero(found.quality != MARK) < 0.005 * count  # what passes for a node, but is none


def mutated(stream: bytes, random: Random) -> tuple[bytes, list[bytes]]:
    """Return the stream with something wrong every 50 nodes or so, and the nodes that are whole in it."""
    pieces, untouched, at = [], [], 0
    while len(stream) - at > NODE_SIZE * 100:
        run = stream[at : at + NODE_SIZE * random.randint(20, 80)]
        pieces.append(run)
        untouched += [run[i : i + NODE_SIZE] for i in range(0, len(run), NODE_SIZE)]
        at += len(run)
        victim = bytearray(stream[at : at + NODE_SIZE])
        at += NODE_SIZE
        match random.randrange(4):
            case 0:  # a few bits turn over
                for _ in range(random.randint(1, 3)):
                    victim[random.randrange(NODE_SIZE)] ^= 1 << random.randrange(8)
            case 1:  # bytes are lost
                del victim[: random.randint(1, NODE_SIZE)]
            case 2:  # bytes come twice
                victim += victim[: random.randint(1, NODE_SIZE)]
            case _:  # noise comes between
                victim += random.randbytes(random.randint(1, 40))
        pieces.append(bytes(victim))
    return b"".join(pieces), untouched


def test_a_million_random_bytes_into_the_other_end_raise_nothing() -> None:
    random = Random(4)  # noqa: S311 - chance, not a secret
    finder = RequestFinder()
    for piece in cut(random.randbytes(MILLION), random):
        for command, payload in finder.feed(piece):
            assert command >= 0x80 or not payload
