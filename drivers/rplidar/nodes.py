"""The nodes of a scan, five bytes for each measurement, many at once as arrays.

Byte 0: bit 0 S (a turn begins), bit 1 its opposite, bits 2 to 7 the quality. Bytes 1 and 2: bit 0 is always 1, the rest
the angle in 1/64 degree, clockwise seen from above. Bytes 3 and 4: the distance in 1/4 mm, 0 where nothing came back.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

SIZE = 5
"""Bytes of a node."""

TURN = 360 * 64
"""Steps of the angle in a whole turn."""

ROW = 4
"""How many nodes must follow one another before bytes that have been out of step count as nodes again."""

_KNOWN = SIZE * (ROW - 2)
"""Bytes from the first to the last pair of nodes in a row."""

LEAP = 30 * 64
"""Steps of the angle within which a node follows another. A1s work out where a beam went from how far it went, so that
from something near to something far the angle leaps, and not always forward."""

WINDOW = 256
"""Bytes in which a row is looked for at a time: mostly it begins in the first few."""

Bytes = npt.NDArray[np.uint8]
Flags = npt.NDArray[np.bool_]
Words = npt.NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Nodes:
    """Measurements in the order in which they were taken, as raw numbers of the wire; all of shape (n,).

    ``new``: bool, the first of a turn. ``quality``: uint8, 0..63. ``angle``: uint16, 1/64 degree, clockwise.
    ``distance``: uint16, 1/4 mm, 0 for none.
    """

    new: Flags
    quality: Bytes
    angle: Words
    distance: Words

    def __len__(self) -> int:
        return len(self.angle)

    def pack(self) -> bytes:
        """Return their bytes."""
        low = self.angle.astype(np.uint32) << 1 | 1
        raw = np.empty((len(self), SIZE), dtype=np.uint8)
        raw[:, 0] = self.quality << 2 | np.where(self.new, 1, 2)
        raw[:, 1], raw[:, 2] = low & 0xFF, low >> 8
        raw[:, 3], raw[:, 4] = self.distance & 0xFF, self.distance >> 8
        return raw.tobytes()

    @classmethod
    def unpack(cls, raw: Bytes) -> Self:
        """Read nodes from shape (n, 5); their check bits are not looked at."""
        first, wide = raw[:, 0], raw.astype(np.uint16)
        quality = np.right_shift(first, 2, dtype=np.uint8)
        angle: Words = wide[:, 1] // 2 + wide[:, 2] * np.uint16(128)
        distance: Words = wide[:, 3] + wide[:, 4] * np.uint16(256)
        return cls(first & 1 == 1, quality, angle, distance)


class NodeFinder:
    """Finds nodes in a stream that is cut anywhere and may hold noise.

    Check bits alone do not keep it in step: one place of noise in four passes, and where a wall is as far for a while
    so do bytes that are out of step. So a node must also follow the one before it: have another angle, but not by more
    than ``LEAP``, where both measured something. Once one does not, bytes are dropped until ``ROW`` nodes do.
    """

    behind = 0.0
    """Seconds by which a measurement is given out later than it came."""

    def __init__(self) -> None:
        self.nodes = 0
        self.skipped_bytes = 0
        self.slips = 0
        """How often bytes had to be dropped."""
        self._last = b""  # the node found last; empty while out of step
        self._rest = b""

    def restart(self) -> None:
        """Forget what has half come; the counters stay."""
        self._last = self._rest = b""

    def feed(self, data: bytes) -> Nodes:
        """Take bytes as they come; return the nodes that are known for such now, in order."""
        raw = np.frombuffer(self._last + self._rest + data, dtype=np.uint8)
        follows = _follows(raw)
        places = [np.empty(0, dtype=np.int64)]  # of the first bytes
        at, in_step = 0, bool(self._last)
        while True:
            if not in_step:
                row = _row(follows, at)
                self.skipped_bytes += row - at
                self.slips += row > at
                at = row
                if at + _KNOWN >= len(follows):
                    break  # a row may begin here, but has not all come
                places.append(np.array([at]))
            run = follows[at::SIZE]
            length = len(run) if run.all() else int(run.argmin())
            places.append(np.arange(at + SIZE, at + SIZE * (length + 1), SIZE))
            at += SIZE * length
            in_step = length == len(run)
            if in_step:
                break
            at += SIZE
        split = at + SIZE * in_step
        self._last, self._rest = raw[at:split].tobytes(), raw[split:].tobytes()
        first = np.concatenate(places)
        self.nodes += len(first)
        return Nodes.unpack(raw[first[:, None] + np.arange(SIZE)])


def _follows(raw: Bytes) -> Flags:
    """Return for each place whether a node begins there, and another that follows it right behind."""
    if len(raw) < 2 * SIZE:
        return np.empty(0, dtype=np.bool_)
    checks = ((raw ^ raw >> 1)[: 1 - SIZE] & raw[1 : 2 - SIZE] & 1).astype(np.bool_)
    wide = raw.astype(np.int32)
    angle = wide[1 : 2 - SIZE] // 2 + wide[2 : 3 - SIZE] * 128
    nothing = raw[3 : 4 - SIZE] | raw[4:] == 0
    turned = (angle[SIZE:] - angle[:-SIZE]) % TURN
    near = (turned != 0) & ((turned < LEAP) | (turned > TURN - LEAP))
    follows: Flags = checks[:-SIZE] & checks[SIZE:] & (near | nothing[:-SIZE] | nothing[SIZE:])
    return follows


def _row(follows: Flags, at: int) -> int:
    """Return the first place from ``at`` on where ``ROW`` nodes come in a row, or where that is not known yet."""
    unknown = len(follows) - _KNOWN
    for start in range(at, unknown, WINDOW):
        end = min(start + WINDOW, unknown)
        rows = np.logical_and.reduce([follows[start + shift : end + shift] for shift in range(0, _KNOWN + 1, SIZE)])
        if rows.any():
            return start + int(rows.argmax())
    return max(at, unknown)
