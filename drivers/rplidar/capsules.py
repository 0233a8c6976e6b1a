"""Capsules of an express scan: 84 bytes for 32 measurements, at twice the rate of a plain scan.

Bytes 0 and 1: A and 5 in the upper halves, the XOR of all other bytes in the lower halves. Bytes 2 and 3: the angle of
the first measurement in 1/64 degree, clockwise; bit 15 is set in the first capsule of a scan. Then sixteen groups
("cabins") of five bytes follow, each with two measurements. Bytes 0 and 1, and 2 and 3, of a cabin are the two
distances in mm, from bit 2 on; their bits 0 and 1 are the upper bits of the angle corrections. Byte 4 has the lower
four bits of both corrections, in 1/8 degree, without a sign, as in the vendor's driver. The angles of the measurements
are interpolated between two capsules, so a capsule is decoded only when the next one has arrived.
"""

from functools import reduce
from operator import xor

import numpy as np
import numpy.typing as npt

from drivers.rplidar.nodes import STEPS_PER_TURN, Nodes, Words

CAPSULE_SIZE, CAPSULE_NODES = 84, 32
"""Bytes of a capsule, and measurements in it."""

EXPRESS_SAMPLE_RATE = 4000.0
"""Measurements per second of an express scan."""

NODE_QUALITY = 47
"""Quality of each measurement with an echo, as in the vendor's driver: a capsule has none."""

_FIRST = 1 << 15
_MAX_ANGLE_STEP = 60 * 64  # maximum steps of the angle between two capsules
_DISTANCE = 0xFFFC


def pack_capsule(angle: int, distance: Words, *, first: bool = False) -> bytes:
    """Return the bytes of a capsule with its ``angle`` (1/64 degree) and 32 distances (1/4 mm, truncated to mm).

    ``first`` marks the first capsule of a scan.
    """
    body = (angle | first << 15).to_bytes(2, "little")
    pairs = (distance & _DISTANCE).astype("<u2").reshape(-1, 2)
    body += b"".join(pair.tobytes() + b"\0" for pair in pairs)
    check = reduce(xor, body)
    return bytes((0xA0 | check & 0xF, 0x50 | check >> 4)) + body


NO_NODES = Nodes(np.empty(0, np.bool_), np.empty(0, np.uint8), np.empty(0, np.uint16), np.empty(0, np.uint16))


class CapsuleFinder:
    """Finds capsules in a stream of bytes, and decodes them. Capsules with a wrong checksum are dropped.

    The counters ``nodes``, ``skipped_bytes`` and ``resyncs`` are as in ``drivers.rplidar.nodes.NodeFinder``.
    """

    delay = CAPSULE_NODES / EXPRESS_SAMPLE_RATE
    """Seconds by which the decoding of a capsule is late, since it needs the next capsule."""

    def __init__(self) -> None:
        self.nodes = 0
        self.skipped_bytes = 0
        self.resyncs = 0
        self._last: bytes | None = None
        self._place: float | None = None  # of the previous node
        self._rest = b""

    def restart(self) -> None:
        """Drop the incomplete capsule; the counters are kept."""
        self._last, self._place, self._rest = None, None, b""

    def feed(self, data: bytes) -> Nodes:
        """Add received bytes; return the nodes of the capsules that can be decoded, in order."""
        buffer, at, parts = self._rest + data, 0, list[Nodes]()
        while len(buffer) - at >= CAPSULE_SIZE:
            here = buffer[at : at + CAPSULE_SIZE]
            if not _is_valid(here):
                self.resyncs += self._last is not None
                self._last = None
                self.skipped_bytes += 1
                at += 1
                continue
            at += CAPSULE_SIZE
            if self._last is not None and not _starts_scan(here):
                turned = (_start_angle(here) - _start_angle(self._last)) % STEPS_PER_TURN
                if turned <= _MAX_ANGLE_STEP:
                    parts.append(self._read(self._last, turned))
            self._last = here
        self._rest = buffer[at:]
        return _concatenate([NO_NODES, *parts])

    def _read(self, data: bytes, turned: int) -> Nodes:
        """Return the measurements of a capsule; ``turned`` is the angle to the next capsule (1/64 degree)."""
        cabins = np.frombuffer(data[4:], np.uint8).reshape(-1, 5).astype(np.uint16)
        words = (cabins[:, 0:4:2] | cabins[:, 1:4:2] << 8).reshape(-1)
        low = np.stack((cabins[:, 4] & 0xF, cabins[:, 4] >> 4), axis=1).reshape(-1)
        less = (low | (words & 3) << 4).astype(np.int32) * 8
        place = (_start_angle(data) + np.arange(CAPSULE_NODES) * (turned / CAPSULE_NODES)) % STEPS_PER_TURN
        before = np.concatenate(([place[0] if self._place is None else self._place], place[:-1]))
        self._place = float(place[-1])
        distance = (words & _DISTANCE).astype(np.uint16)
        angle: npt.NDArray[np.float64] = np.floor(place - less) % STEPS_PER_TURN
        self.nodes += CAPSULE_NODES
        quality = np.where(distance > 0, NODE_QUALITY, 0).astype(np.uint8)
        return Nodes(place < before, quality, angle.astype(np.uint16), distance)


def _is_valid(data: bytes) -> bool:
    if data[0] >> 4 != 0xA or data[1] >> 4 != 0x5:
        return False
    return reduce(xor, data[2:]) == data[0] & 0xF | (data[1] & 0xF) << 4


def _starts_scan(data: bytes) -> bool:
    return bool(data[3] >> 7)


def _start_angle(data: bytes) -> int:
    return int.from_bytes(data[2:4], "little") & ~_FIRST


def _concatenate(parts: list[Nodes]) -> Nodes:
    return Nodes(
        np.concatenate([each.new for each in parts]),
        np.concatenate([each.quality for each in parts]),
        np.concatenate([each.angle for each in parts]),
        np.concatenate([each.distance for each in parts]),
    )
