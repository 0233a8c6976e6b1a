"""The serial protocol of WitMotion's IMUs: bytes from and to values. Source: WitMotion's standard protocol.

A report is three packets of eleven bytes: acceleration, rates, angles; each ``0x55``, its kind, four numbers of 16
bits, and the sum of the ten bytes before. Nothing is asked: they come at a rate that can be set.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi

HEADER = 0x55
PACKET_SIZE = 11
ACCELERATION, RATES, ANGLES = 0x51, 0x52, 0x53

PACKET_KINDS = frozenset(range(0x50, 0x5B))
"""The kinds of packets that there are; those that are not of a report are passed over."""

FORCE_PER_STEP = 16 * 9.80665 / 32768
RATE_PER_STEP = 2000 * pi / 180 / 32768
ANGLE_PER_STEP = pi / 32768
"""What one step is worth, in m/s2, rad/s, rad."""

UNLOCK = b"\xff\xaa\x69\x88\xb5"
"""Lets it be told something, for ten seconds; without a later save, it is forgotten with its power."""

HUNDRED_HERTZ = b"\xff\xaa\x03\x09\x00"
"""Have a hundred reports a second."""

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class WitMotionReport:
    """One report: forces (m/s2), rates (rad/s), angles (rad) about x, y, z as printed on the case."""

    forces: Triple
    rates: Triple
    angles: Triple


def packet(kind: int, values: Triple, unit: float) -> bytes:
    """Return one packet."""
    steps = [min(max(round(value / unit), -32768), 32767) for value in values]
    body = struct.pack("<BB4h", HEADER, kind, *steps, 0)
    return body + bytes([sum(body) & 0xFF])


def pack(report: WitMotionReport) -> bytes:
    """Return the packets of a report."""
    return (
        packet(ACCELERATION, report.forces, FORCE_PER_STEP)
        + packet(RATES, report.rates, RATE_PER_STEP)
        + packet(ANGLES, report.angles, ANGLE_PER_STEP)
    )


class WitMotionReportFinder:
    """Finds reports in bytes that are cut anywhere. ``malformed`` counts what looked like a packet and was none."""

    def __init__(self) -> None:
        self.malformed = 0
        self._bytes = b""
        self._packets: dict[int, Triple] = {}

    def feed(self, data: bytes) -> Iterator[WitMotionReport]:
        """Yield the reports that are whole by now: each with its angles, which come last."""
        self._bytes += data
        while (start := self._bytes.find(HEADER)) >= 0 and len(self._bytes) >= start + PACKET_SIZE:
            found = self._bytes[start : start + PACKET_SIZE]
            if found[1] not in PACKET_KINDS or sum(found[:-1]) & 0xFF != found[-1]:
                self.malformed += found[1] in PACKET_KINDS
                self._bytes = self._bytes[start + 1 :]
                continue
            self._bytes = self._bytes[start + PACKET_SIZE :]
            report = self._handle_packet(found)
            if report is not None:
                yield report
        if HEADER not in self._bytes:
            self._bytes = b""

    def _handle_packet(self, found: bytes) -> WitMotionReport | None:
        _, kind, x, y, z, _ = struct.unpack("<BB4h", found[:-1])
        unit = {ACCELERATION: FORCE_PER_STEP, RATES: RATE_PER_STEP, ANGLES: ANGLE_PER_STEP}.get(kind)
        if unit is None:
            return None
        self._packets[kind] = (x * unit, y * unit, z * unit)
        if kind != ANGLES or len(self._packets) < 3:
            return None
        heard, self._packets = self._packets, {}
        return WitMotionReport(heard[ACCELERATION], heard[RATES], heard[ANGLES])
