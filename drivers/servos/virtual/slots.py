"""Replies of virtual servos as they meet on the one wire: in turn, or on top of each other."""

from collections.abc import Sequence

from drivers.servos.virtual.servo import VirtualServo

Slot = list[tuple[VirtualServo, bytes]]
"""Replies to one request: that of one servo, or those of several that share an ID."""

SAMPLES_PER_BIT = 8
"""Samples that a receiver takes of each bit."""

BITS_PER_BYTE = 10
"""Bits of a byte on the wire: a start bit (low), eight, the lowest first, and a stop bit (high)."""

Burst = tuple[float, bytes]
"""Bytes without a pause between them, and when they begin: in bits after the request."""


def overlay(replies: Sequence[bytes]) -> bytes:
    """Return what is read when ``replies`` are sent at the same moment: any sender pulls the wire low."""
    return b"".join(data for _, data in merge_replies([(0.0, reply) for reply in replies]))


def merge_replies(replies: Sequence[Burst]) -> list[Burst]:
    """Return what a receiver makes of replies that may overlap: the idle wire is high, any sender pulls it low.

    A byte whose stop bit is low is read as 0, as Linux does. What does not overlap stays apart.
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
    """Return the level of the wire, 1 for high, at each sample."""
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
