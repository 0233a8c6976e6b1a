"""The serial protocol of WitMotion's IMUs: bytes from and to values. Source: WitMotion's standard protocol.

A report is three packets of eleven bytes: acceleration, rates, angles; each ``0x55``, its kind, four numbers of 16
bits, and the sum of the ten bytes before. Nothing is asked: they come at a rate that can be set.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi

HEAD = 0x55
SIZE = 11
ACCELERATION, RATES, ANGLES = 0x51, 0x52, 0x53

KINDS = frozenset(range(0x50, 0x5B))
"""The kinds of packets that there are; those that are not of a report are passed over."""

FORCE = 16 * 9.80665 / 32768
RATE = 2000 * pi / 180 / 32768
ANGLE = pi / 32768
"""What one step is worth, in m/s2, rad/s, rad."""

UNLOCK = b"\xff\xaa\x69\x88\xb5"
"""Lets it be told something, for ten seconds; without a later save, it is forgotten with its power."""

HUNDRED_HERTZ = b"\xff\xaa\x03\x09\x00"
"""Have a hundred reports a second."""

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Report:
    """One report: forces (m/s2), rates (rad/s), angles (rad) about x, y, z as printed on the case."""

    forces: Triple
    rates: Triple
    angles: Triple


def packet(kind: int, values: Triple, unit: float) -> bytes:
    """Return one packet."""
    steps = [min(max(round(value / unit), -32768), 32767) for value in values]
    body = struct.pack("<BB4h", HEAD, kind, *steps, 0)
    return body + bytes([sum(body) & 0xFF])


def pack(report: Report) -> bytes:
    """Return the packets of a report."""
    return (
        packet(ACCELERATION, report.forces, FORCE)
        + packet(RATES, report.rates, RATE)
        + packet(ANGLES, report.angles, ANGLE)
    )


class Finder:
    """Finds reports in bytes that are cut anywhere. ``malformed`` counts what looked like a packet and was none."""

    def __init__(self) -> None:
        self.malformed = 0
        self._bytes = b""
        self._heard: dict[int, Triple] = {}

    def feed(self, data: bytes) -> Iterator[Report]:
        """Yield the reports that are whole by now: each with its angles, which come last."""
        self._bytes += data
        while (start := self._bytes.find(HEAD)) >= 0 and len(self._bytes) >= start + SIZE:
            found = self._bytes[start : start + SIZE]
            if found[1] not in KINDS or sum(found[:-1]) & 0xFF != found[-1]:
                self.malformed += found[1] in KINDS
                self._bytes = self._bytes[start + 1 :]
                continue
            self._bytes = self._bytes[start + SIZE :]
            report = self._take(found)
            if report is not None:
                yield report
        if HEAD not in self._bytes:
            self._bytes = b""

    def _take(self, found: bytes) -> Report | None:
        _, kind, x, y, z, _ = struct.unpack("<BB4h", found[:-1])
        unit = {ACCELERATION: FORCE, RATES: RATE, ANGLES: ANGLE}.get(kind)
        if unit is None:
            return None
        self._heard[kind] = (x * unit, y * unit, z * unit)
        if kind != ANGLES or len(self._heard) < 3:
            return None
        heard, self._heard = self._heard, {}
        return Report(heard[ACCELERATION], heard[RATES], heard[ANGLES])
