"""Serial protocol of WitMotion's IMUs, by WitMotion's standard protocol.

A report is three packets of eleven bytes: acceleration, turn rates, angles. A packet is ``0x55``, its kind, four
numbers of 16 bits, and the sum of the ten bytes before. Reports are sent periodically, at a configurable rate.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi

HEADER = 0x55
PACKET_SIZE = 11
ACCELERATION, RATES, ANGLES = 0x51, 0x52, 0x53

PACKET_KINDS = frozenset(range(0x50, 0x5B))
"""Kinds of packets; those that are not part of a report are skipped."""

FORCE_PER_STEP = 16 * 9.80665 / 32768
RATE_PER_STEP = 2000 * pi / 180 / 32768
ANGLE_PER_STEP = pi / 32768
"""Angle in radians of one step on the wire."""

UNLOCK = b"\xff\xaa\x69\x88\xb5"
"""Command that permits settings for ten seconds. Settings that are not saved are lost at power-off."""

HUNDRED_HERTZ = b"\xff\xaa\x03\x09\x00"
"""Command that sets 100 reports per second."""

Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class WitMotionReport:
    """Report of an IMU: acceleration ``forces`` (m/s2), turn ``rates`` (rad/s) and ``angles`` (rad) about x, y, z.

    The axes are those printed on the case.
    """

    forces: Triple
    rates: Triple
    angles: Triple


def packet(kind: int, values: Triple, unit: float) -> bytes:
    """Return the bytes of one packet of a report, with three ``values`` in steps of ``unit``."""
    steps = [min(max(round(value / unit), -32768), 32767) for value in values]
    body = struct.pack("<BB4h", HEADER, kind, *steps, 0)
    return body + bytes([sum(body) & 0xFF])


def pack(report: WitMotionReport) -> bytes:
    """Return the bytes of a report's packets."""
    return (
        packet(ACCELERATION, report.forces, FORCE_PER_STEP)
        + packet(RATES, report.rates, RATE_PER_STEP)
        + packet(ANGLES, report.angles, ANGLE_PER_STEP)
    )


class WitMotionReportFinder:
    """Finds reports in a stream of bytes. ``malformed`` counts packets with a wrong checksum."""

    def __init__(self) -> None:
        self.malformed = 0
        self._bytes = b""
        self._packets: dict[int, Triple] = {}

    def feed(self, data: bytes) -> Iterator[WitMotionReport]:
        """Add received bytes; yield each complete report. The packet with the angles completes a report."""
        self._bytes += data
        while (start := self._bytes.find(HEADER)) >= 0 and len(self._bytes) >= start + PACKET_SIZE:
            packet = self._bytes[start : start + PACKET_SIZE]
            if packet[1] not in PACKET_KINDS or sum(packet[:-1]) & 0xFF != packet[-1]:
                self.malformed += packet[1] in PACKET_KINDS
                self._bytes = self._bytes[start + 1 :]
                continue
            self._bytes = self._bytes[start + PACKET_SIZE :]
            report = self._handle_packet(packet)
            if report is not None:
                yield report
        if HEADER not in self._bytes:
            self._bytes = b""

    def _handle_packet(self, packet_data: bytes) -> WitMotionReport | None:
        _, kind, x, y, z, _ = struct.unpack("<BB4h", packet_data[:-1])
        unit = {ACCELERATION: FORCE_PER_STEP, RATES: RATE_PER_STEP, ANGLES: ANGLE_PER_STEP}.get(kind)
        if unit is None:
            return None
        self._packets[kind] = (x * unit, y * unit, z * unit)
        if kind != ANGLES or len(self._packets) < 3:
            return None
        packets, self._packets = self._packets, {}
        return WitMotionReport(packets[ACCELERATION], packets[RATES], packets[ANGLES])
