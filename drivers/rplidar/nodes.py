"""Nodes of a plain RPLIDAR scan, five bytes for each measurement, decoded in bulk as arrays.

Byte 0: bit 0 S (start flag, first node of a turn), bit 1 its inverse, bits 2 to 7 the quality. Bytes 1 and 2: bit 0 is
always 1, the rest is the angle in 1/64 degree, clockwise from above. Bytes 3 and 4: the distance in 1/4 mm, 0 without
an echo.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

NODE_SIZE = 5
"""Bytes of a node."""

STEPS_PER_TURN = 360 * 64
"""Number of angle steps of 1/64 degree in a full turn."""

MIN_NODES_IN_ROW = 4
"""Number of consecutive nodes after which bytes count as synchronised again."""

_ROW_SPAN = NODE_SIZE * (MIN_NODES_IN_ROW - 2)
"""Distance in bytes from the first to the last but one of ``MIN_NODES_IN_ROW`` consecutive nodes."""

MAX_ANGLE_STEP = 30 * 64
"""Maximum difference of the angles of two consecutive nodes, in 1/64 degree.

An A1 corrects the angle of a beam by its distance, so at the edge of an object the angle jumps, sometimes backwards.
"""

SEARCH_WINDOW = 256
"""Number of positions that are searched at once for a row of nodes, which is usually at one of the first."""

Bytes = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.bool_]
Words = npt.NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Nodes:
    """Measurements of a scan in order of time, as the raw values on the wire. All arrays have the shape (n,).

    ``new``: bool, True for the first node of a turn. ``quality``: uint8, 0..63. ``angle``: uint16, 1/64 degree,
    clockwise. ``distance``: uint16, 1/4 mm, 0 without an echo.
    """

    new: Flags
    quality: Bytes
    angle: Words
    distance: Words

    def __len__(self) -> int:
        return len(self.angle)

    def pack(self) -> bytes:
        """Return the bytes of the nodes."""
        low = self.angle.astype(np.uint32) << 1 | 1
        raw = np.empty((len(self), NODE_SIZE), dtype=np.uint8)
        raw[:, 0] = self.quality << 2 | np.where(self.new, 1, 2)
        raw[:, 1], raw[:, 2] = low & 0xFF, low >> 8
        raw[:, 3], raw[:, 4] = self.distance & 0xFF, self.distance >> 8
        return raw.tobytes()

    @classmethod
    def unpack(cls, raw: Bytes) -> Self:
        """Decode nodes from shape (n, 5); the check bits are ignored."""
        first, wide = raw[:, 0], raw.astype(np.uint16)
        quality = np.right_shift(first, 2, dtype=np.uint8)
        angle: Words = wide[:, 1] // 2 + wide[:, 2] * np.uint16(128)
        distance: Words = wide[:, 3] + wide[:, 4] * np.uint16(256)
        return cls(first & 1 == 1, quality, angle, distance)


class NodeFinder:
    """Finds nodes in a stream of bytes, which may arrive in chunks of any size and contain noise.

    The check bits of a node are not enough to find where nodes begin: noise passes them at one position in four. Bytes
    at wrong positions also pass them while the lidar faces a wall at a constant distance. So a node must also follow
    the previous one: its angle differs, by at most ``MAX_ANGLE_STEP`` if both have an echo. After a failure bytes are
    dropped until ``MIN_NODES_IN_ROW`` nodes follow one another.
    """

    delay = 0.0
    """Seconds by which the decoding of a node is late: none. Same attribute as in ``CapsuleFinder``."""

    def __init__(self) -> None:
        self.nodes = 0
        self.skipped_bytes = 0
        self.resyncs = 0
        """Number of times that bytes had to be dropped to find the start of a node again."""
        self._last = b""  # the last node; empty while not synchronised
        self._rest = b""

    def restart(self) -> None:
        """Drop the incomplete node; the counters are kept."""
        self._last = self._rest = b""

    def feed(self, data: bytes) -> Nodes:
        """Add received bytes; return the complete nodes, in order, except those that the next bytes must confirm."""
        raw = np.frombuffer(self._last + self._rest + data, dtype=np.uint8)
        follows = _find_followed(raw)
        places = [np.empty(0, dtype=np.int64)]  # of the first bytes of the nodes
        at, in_step = 0, bool(self._last)
        while True:
            if not in_step:
                row = _find_row(follows, at)
                self.skipped_bytes += row - at
                self.resyncs += row > at
                at = row
                if at + _ROW_SPAN >= len(follows):
                    break  # a row may begin here, but is incomplete
                places.append(np.array([at]))
            run = follows[at::NODE_SIZE]
            length = len(run) if run.all() else int(run.argmin())
            places.append(np.arange(at + NODE_SIZE, at + NODE_SIZE * (length + 1), NODE_SIZE))
            at += NODE_SIZE * length
            in_step = length == len(run)
            if in_step:
                break
            at += NODE_SIZE
        split = at + NODE_SIZE * in_step
        self._last, self._rest = raw[at:split].tobytes(), raw[split:].tobytes()
        first = np.concatenate(places)
        self.nodes += len(first)
        return Nodes.unpack(raw[first[:, None] + np.arange(NODE_SIZE)])


def _find_followed(raw: Bytes) -> Flags:
    """Return for each position in ``raw`` whether a node begins there that is followed by another node."""
    if len(raw) < 2 * NODE_SIZE:
        return np.empty(0, dtype=np.bool_)
    checks = ((raw ^ raw >> 1)[: 1 - NODE_SIZE] & raw[1 : 2 - NODE_SIZE] & 1).astype(np.bool_)
    wide = raw.astype(np.int32)
    angle = wide[1 : 2 - NODE_SIZE] // 2 + wide[2 : 3 - NODE_SIZE] * 128
    nothing = raw[3 : 4 - NODE_SIZE] | raw[4:] == 0
    turned = (angle[NODE_SIZE:] - angle[:-NODE_SIZE]) % STEPS_PER_TURN
    near = (turned != 0) & ((turned < MAX_ANGLE_STEP) | (turned > STEPS_PER_TURN - MAX_ANGLE_STEP))
    follows: Flags = checks[:-NODE_SIZE] & checks[NODE_SIZE:] & (near | nothing[:-NODE_SIZE] | nothing[NODE_SIZE:])
    return follows


def _find_row(follows: Flags, at: int) -> int:
    """Return the first position from ``at`` on at which ``MIN_NODES_IN_ROW`` nodes begin.

    Near the end of the data, return the first position at which such a row may begin but is incomplete.
    """
    unknown = len(follows) - _ROW_SPAN
    for start in range(at, unknown, SEARCH_WINDOW):
        end = min(start + SEARCH_WINDOW, unknown)
        rows = np.logical_and.reduce(
            [follows[start + shift : end + shift] for shift in range(0, _ROW_SPAN + 1, NODE_SIZE)]
        )
        if rows.any():
            return start + int(rows.argmax())
    return max(at, unknown)
