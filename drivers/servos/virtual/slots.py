"""Replies of virtual servos on the shared wire: one after the other, or colliding."""

from collections.abc import Sequence

from drivers.servos.virtual.servo import VirtualServo

Slot = list[tuple[VirtualServo, bytes]]
"""Replies to one request: of one servo, or of several that share an ID."""

SAMPLES_PER_BIT = 8
"""Samples per bit of the simulated receiver."""

BITS_PER_BYTE = 10
"""Bits of a byte on the wire: start bit (low), eight data bits (lowest first), stop bit (high)."""

Burst = tuple[float, bytes]
"""Bytes that are sent without a pause, and the time of their start in bits after the request."""


def overlay(replies: Sequence[bytes]) -> bytes:
    """Return the received bytes if ``replies`` are sent at the same moment, and any sender can pull the wire low."""
    return b"".join(data for _, data in merge_replies([(0.0, reply) for reply in replies]))


def merge_replies(replies: Sequence[Burst]) -> list[Burst]:
    """Return the bytes that are received from possibly overlapping replies: any sender pulls the idle-high wire low.

    A byte with a low stop bit is received as 0, as on Linux. Separate replies stay separate.
    """
    if len(replies) == 1:
        return list(replies)
    wire = _levels(replies)
    found: list[tuple[float, bytearray]] = []
    at, end = 0, len(wire) - BITS_PER_BYTE * SAMPLES_PER_BIT
    while at <= end:
        if wire[at]:
            at += 1
            continue
        bits = [wire[at + bit * SAMPLES_PER_BIT + SAMPLES_PER_BIT // 2] for bit in range(BITS_PER_BYTE)]
        if bits[0]:  # a glitch
            at += 1
            continue
        value = sum(bit << place for place, bit in enumerate(bits[1:9])) if bits[9] else 0
        begin = at / SAMPLES_PER_BIT
        at += (BITS_PER_BYTE - 1) * SAMPLES_PER_BIT + SAMPLES_PER_BIT // 2
        while at < len(wire) and not wire[at]:
            at += 1
        if not found or begin > found[-1][0] + (len(found[-1][1]) + 1) * BITS_PER_BYTE:
            found.append((begin, bytearray()))
        found[-1][1].append(value)
    return [(begin, bytes(data)) for begin, data in found]


def _levels(replies: Sequence[Burst]) -> list[int]:
    """Return the level of the wire at each sample, 1 for high."""
    length = max(round((begin + len(data) * BITS_PER_BYTE) * SAMPLES_PER_BIT) for begin, data in replies)
    wire = [1] * (length + BITS_PER_BYTE * SAMPLES_PER_BIT)
    for begin, data in replies:
        start = round(begin * SAMPLES_PER_BIT)
        for place, value in enumerate(data):
            frame = value << 1 | 1 << 9
            for bit in range(BITS_PER_BYTE):
                if not frame >> bit & 1:
                    low = start + (place * BITS_PER_BYTE + bit) * SAMPLES_PER_BIT
                    wire[low : low + SAMPLES_PER_BIT] = [0] * SAMPLES_PER_BIT
    return wire
