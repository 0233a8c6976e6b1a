"""Points that a range finder has seen, in the odometry frame, with upper bounds of their speeds.

A point where an earlier scan saw free space belongs to a moving object. Its speed is the distance to the nearest point
of that scan, divided by the time between the scans. Points for which the newest scan has no echo are kept for a while,
since a range finder does not see very near objects, or black legs.
"""

from collections import deque
from math import cos, isfinite, sin, tau

import numpy as np
import numpy.typing as npt

from drivers.api import RangeScan
from drivers.api.fast_dataclass import dataclass
from drivers.base.footprint import Floats

# Validation of scans: a third-party range finder, or a node of ROS 2, may send anything.


def flaw_of(scan: RangeScan) -> str:
    """Return why a scan is invalid, such as a time that is not a number; empty if it is valid.

    A scan without any echo is valid.
    """
    if getattr(scan.ranges, "ndim", 0) != 1:
        return "its scan is not an array of one dimension"
    if not len(scan.ranges):
        return "its scan has no beams"
    if not (isfinite(scan.start) and isfinite(scan.step) and scan.step > 0.0):
        return f"its scan begins at {scan.start} rad with a step of {scan.step} rad between beams"
    if not isfinite(scan.stamp):
        return f"its scan has the time {scan.stamp}"
    return ""


Placed = tuple[float, float, float]
"""A pose: heading in radians, x and y in metres, in the order of a base's pose history."""

MAX_SPEED = 1.0
"""Maximum speed of a seen point in m/s."""

COMPARED_AFTER = 0.3
"""Minimum seconds between two scans that are compared, so that a walking person moves more than the noise."""

NOISE, NOISE_SHARE, NOISE_TURNING = 0.04, 0.02, 0.08
"""Error of a point in metres, and as a share of its distance, at rest and per rad/s of the turn rate."""

MOVING_FOR, MOVING_NEAR = 1.0, 0.5
"""Seconds for which a point that is so near (m) to a moved one has the speed of that: people turn round and stop for
a moment."""

NEAR = 1.5
"""Distance in metres from the range finder within which points are kept when the newest scan no longer shows them."""

KEPT, KEPT_TOO_NEAR = 1.0, 5.0
"""Seconds for which a point is kept after scans stop to show it: usually, and if it is near the minimum range."""

TOO_NEAR = 0.05
"""Distance in metres that is added to the minimum range of the range finder: scans may not show nearer points."""

NARROW = 0.21
"""Maximum width in radians of a gap between beams that is ignored: it hides no leg at half a metre."""

MAX_POINTS = 720

MAX_MOVED = 24
"""Maximum number of moving points stored for a scan, which limits the time for comparing them."""


@dataclass(frozen=True, slots=True)
class PlacedScan:
    """A scan, the pose of the range finder when it was measured, and its points in the odometry frame (metres)."""

    scan: RangeScan
    heading: float
    x: float
    y: float
    points_x: Floats
    points_y: Floats


class SeenPoints:
    """Points of the newest scan, and kept points of earlier scans. Not thread-safe.

    ``place`` is the pose of the range finder on the base, ``blind`` are the sectors that it does not see. ``x`` and
    ``y`` (metres, odometry frame) and ``speeds`` (m/s) have the shape (n,). ``moving`` is True if any point moves.
    """

    def __init__(self, place: tuple[float, float, float], blind: tuple[tuple[float, float], ...] = ()) -> None:
        self.x: Floats = np.empty(0)
        self.y: Floats = np.empty(0)
        self.speeds: Floats = np.empty(0)
        self.moving = False
        self.place = place
        self.gaps: tuple[tuple[float, float], ...] = ()
        """Directions that the range finder does not see: first bearing and width in radians."""
        self._blind = tuple((first, (second - first) % tau) for first, second in blind)
        self._earlier: deque[PlacedScan] = deque()
        self._seen_at: Floats = np.empty(0)
        self._moved: deque[tuple[float, Floats, Floats, Floats]] = deque()  # times, places and speeds of moved points

    def add(self, scan: RangeScan, pose: Placed, now: float) -> None:
        """Add a new scan; ``pose`` is the pose of the base when it was measured."""
        placed = self._placed(_thinned(scan), pose)
        speeds = self._carry_over_speeds(placed, self._speeds(placed), now)
        kept = self._unconfirmed(placed, now)
        self.x = np.concatenate((placed.points_x, self.x[kept]))
        self.y = np.concatenate((placed.points_y, self.y[kept]))
        self.speeds = np.concatenate((speeds, np.zeros(int(kept.sum()))))
        self._seen_at = np.concatenate((np.full(len(speeds), now), self._seen_at[kept]))
        self.moving = bool(speeds.any())
        self.gaps = tuple(gap for gap in (*self._blind, *_unscanned(scan)) if gap[1] > NARROW)
        self._earlier.append(placed)
        while len(self._earlier) > 1 and scan.stamp - self._earlier[1].scan.stamp >= COMPARED_AFTER:
            self._earlier.popleft()

    def _placed(self, scan: RangeScan, pose: Placed) -> PlacedScan:
        heading, x, y = pose
        ahead, left, _ = self.place
        x, y = x + ahead * cos(heading) - left * sin(heading), y + ahead * sin(heading) + left * cos(heading)
        seen = np.isfinite(scan.ranges)
        far, bearings = scan.ranges[seen].astype(np.float64), heading + scan.bearings()[seen]
        return PlacedScan(scan, heading, x, y, x + far * np.cos(bearings), y + far * np.sin(bearings))

    def _speeds(self, placed: PlacedScan) -> Floats:
        """Return the speed in m/s of each point of a new scan; 0 for a point that has not moved."""
        speeds: Floats = np.zeros(len(placed.points_x))
        before = self._earlier[0] if self._earlier else None
        past = 0.0 if before is None else placed.scan.stamp - before.scan.stamp
        if before is None or past < COMPARED_AFTER or not len(before.points_x):
            return speeds
        turning = abs(placed.heading - before.heading) / past
        index, distance = _beams(before, placed.points_x, placed.points_y)
        farthest = before.scan.most if np.isfinite(before.scan.most) else 100.0
        ranges = np.nan_to_num(before.scan.ranges.astype(np.float64), nan=farthest)
        seen = np.minimum(ranges, np.minimum(np.roll(ranges, 1), np.roll(ranges, -1)))
        noise = _noise(distance, turning)
        inside = index < len(ranges)
        came = np.flatnonzero(inside & (seen[np.where(inside, index, 0)] > distance + noise))
        if not len(came):
            return speeds
        away = _squares(placed.points_x[came], placed.points_y[came], before.points_x, before.points_y)
        moves = np.sqrt(away.min(axis=1)) > noise[came]  # else it belongs to the edge of a known object
        # It came from a point of the earlier scan that is empty now; a point that is still there is another object.
        away[:, _still_seen(placed, before.points_x, before.points_y, turning)] = np.inf
        moved = np.sqrt(away.min(axis=1))
        speeds[came] = np.where(moves, np.minimum((moved + noise[came]) / past, MAX_SPEED), 0.0)
        return speeds

    def _carry_over_speeds(self, placed: PlacedScan, speeds: Floats, now: float) -> Floats:
        """Return the speeds of the points of a new scan, raised to the speeds of recently moving points nearby."""
        while self._moved and now - self._moved[0][0] > MOVING_FOR:
            self._moved.popleft()
        found = speeds
        if self._moved and len(speeds):
            x, y, known = (np.concatenate(each) for each in list(zip(*self._moved, strict=True))[1:])
            near = _squares(placed.points_x, placed.points_y, x, y) <= MOVING_NEAR * MOVING_NEAR
            found = np.maximum(found, (near * known.astype(np.float32)).max(axis=1))
        if speeds.any():
            self._moved.append((now, *_representatives(placed, speeds)))
        return found

    def _unconfirmed(self, placed: PlacedScan, now: float) -> npt.NDArray[np.bool_]:
        """Return a mask of the stored points that must be kept: the new scan cannot see them."""
        if not len(self.x):
            return np.zeros(0, dtype=np.bool_)
        index, distance = _beams(placed, self.x, self.y)
        ranges = placed.scan.ranges
        nothing = np.isnan(ranges) & np.isnan(np.roll(ranges, 1)) & np.isnan(np.roll(ranges, -1))
        inside = index < len(ranges)
        unseen = ~inside | nothing[np.where(inside, index, 0)]
        most = np.where(distance <= placed.scan.least + TOO_NEAR, KEPT_TOO_NEAR, KEPT)
        kept: npt.NDArray[np.bool_] = unseen & (distance <= NEAR) & (now - self._seen_at <= most)
        return kept


def _beams(placed: PlacedScan, x: Floats, y: Floats) -> tuple[npt.NDArray[np.intp], Floats]:
    """Return the index of the beam that hits each point, and the distance of the point in metres.

    For a point outside the scan the index is the number of beams or more.
    """
    dx, dy = x - placed.x, y - placed.y
    scan = placed.scan
    around = np.remainder(np.arctan2(dy, dx) - placed.heading - scan.start + scan.step / 2, tau)
    return (around / scan.step).astype(np.intp), np.hypot(dx, dy)


def _squares(x: Floats, y: Floats, other_x: Floats, other_y: Floats) -> npt.NDArray[np.float32]:
    """Return the squared distances of n points from m others: shape (n, m)."""
    # In float32, relative to a near point, which is exact to a millimetre: these arrays take most of the time.
    middle_x, middle_y = float(x.mean()), float(y.mean())
    across = (x - middle_x).astype(np.float32)[:, None] - (other_x - middle_x).astype(np.float32)
    along = (y - middle_y).astype(np.float32)[:, None] - (other_y - middle_y).astype(np.float32)
    across *= across
    along *= along
    across += along
    return across


def _representatives(placed: PlacedScan, speeds: Floats) -> tuple[Floats, Floats, Floats]:
    """Return x, y and speeds of at most ``MAX_MOVED`` moving points of a scan.

    Each stands for several neighbours: it has the position of the nearest and the speed of the fastest.
    """
    moves = np.flatnonzero(speeds)
    several = -(-len(moves) // MAX_MOVED)
    padded = np.append(moves, np.full(-len(moves) % several, moves[-1])).reshape(-1, several)
    x, y = placed.points_x[padded], placed.points_y[padded]
    nearest = np.hypot(x - placed.x, y - placed.y).argmin(axis=1)
    rows = np.arange(len(padded))
    return x[rows, nearest], y[rows, nearest], speeds[padded].max(axis=1)


def _noise(distance: Floats, turning: float) -> Floats:
    """Return the error in metres of points at ``distance`` metres, for a base that turns at ``turning`` rad/s."""
    return NOISE + (NOISE_SHARE + NOISE_TURNING * turning) * distance


def _still_seen(placed: PlacedScan, x: Floats, y: Floats, turning: float) -> npt.NDArray[np.bool_]:
    """Return a mask of the points ``x``, ``y`` of an earlier scan that a newer scan still shows.

    ``turning`` is the turn rate of the base in rad/s.
    """
    index, distance = _beams(placed, x, y)
    ranges = placed.scan.ranges
    inside = index < len(ranges)
    with np.errstate(invalid="ignore"):
        off = np.abs(ranges[np.where(inside, index, 0)] - distance)
        return inside & (off <= _noise(distance, turning))


def _unscanned(scan: RangeScan) -> tuple[tuple[float, float], ...]:
    """Return the sector that a scan does not cover, as first bearing and width in radians; empty for a full turn."""
    width = tau - len(scan.ranges) * scan.step
    return ((scan.start + (len(scan.ranges) - 0.5) * scan.step, width),) if width > 0.0 else ()


def _thinned(scan: RangeScan) -> RangeScan:
    """Return the scan with at most ``MAX_POINTS`` beams; each has the smallest distance of several beams."""
    several = -(-len(scan.ranges) // MAX_POINTS)
    if several == 1:
        return scan
    padded = np.full(-(-len(scan.ranges) // several) * several, np.nan, dtype=np.float32)
    padded[: len(scan.ranges)] = scan.ranges
    groups = np.nan_to_num(padded.reshape(-1, several), nan=np.inf).min(axis=1)
    ranges = np.where(np.isinf(groups), np.nan, groups).astype(np.float32)
    start = scan.start + (several - 1) * scan.step / 2
    return RangeScan(ranges, start, several * scan.step, scan.stamp, scan.number, scan.least, scan.most)
