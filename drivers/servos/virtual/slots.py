"""Replies of virtual servos as they meet on the one wire: in turn, or on top of each other."""

from collections.abc import Sequence

from drivers.servos.virtual.servo import VirtualServo

Slot = list[tuple[VirtualServo, bytes]]
"""Replies to one request: that of one servo, or those of several that share an ID."""

SAMPLES = 8
"""Samples that a receiver takes of each bit."""

FRAME = 10
"""Bits of a byte on the wire: a start bit (low), eight, the lowest first, and a stop bit (high)."""

Burst = tuple[float, bytes]
"""Bytes without a pause between them, and when they begin: in bits after the request."""


def overlaid(replies: Sequence[bytes]) -> bytes:
    """Return what is read when ``replies`` are sent at the same moment: any sender pulls the wire low."""
    return b"".join(data for _, data in collided([(0.0, reply) for reply in replies]))


def collided(replies: Sequence[Burst]) -> list[Burst]:
    """Return what a receiver makes of replies that may overlap: the idle wire is high, any sender pulls it low.

    A byte whose stop bit is low is read as 0, as Linux does. What does not overlap stays apart.
    """
    if len(replies) == 1:
        return list(replies)
    wire = _levels(replies)
    found: list[tuple[float, bytearray]] = []
    at, end = 0, len(wire) - FRAME * SAMPLES
    while at <= end:
        if wire[at]:
            at += 1
            continue
        bits = [wire[at + bit * SAMPLES + SAMPLES // 2] for bit in range(FRAME)]
        if bits[0]:  # a glitch
            at += 1
            continue
        value = sum(bit << place for place, bit in enumerate(bits[1:9])) if bits[9] else 0
        begin = at / SAMPLES
        at += (FRAME - 1) * SAMPLES + SAMPLES // 2
        while at < len(wire) and not wire[at]:
            at += 1
        if not found or begin > found[-1][0] + (len(found[-1][1]) + 1) * FRAME:
            found.append((begin, bytearray()))
        found[-1][1].append(value)
    return [(begin, bytes(data)) for begin, data in found]


def _levels(replies: Sequence[Burst]) -> list[int]:
    """Return the level of the wire, 1 for high, at each sample."""
    length = max(round((begin + len(data) * FRAME) * SAMPLES) for begin, data in replies)
    wire = [1] * (length + FRAME * SAMPLES)
    for begin, data in replies:
        start = round(begin * SAMPLES)
        for place, value in enumerate(data):
            frame = value << 1 | 1 << 9
            for bit in range(FRAME):
                if not frame >> bit & 1:
                    low = start + (place * FRAME + bit) * SAMPLES
                    wire[low : low + SAMPLES] = [0] * SAMPLES
    return wire
