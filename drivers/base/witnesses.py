"""Witnesses of the progress monitor: range finder and IMU, which are compared with the odometry of the base.

They detect that a base does not move although its encoders report motion, or although its pose is dead reckoning. A
range finder gives no result where the scan does not change with the motion, such as in a corridor.
"""

from collections import deque
from math import degrees, remainder, tau

import numpy as np
from numpy.typing import NDArray

from drivers.api import BaseState, Imu, Pose2D, Ranger
from drivers.api.fast_dataclass import dataclass
from drivers.api.measures import Ranges, length_text
from drivers.base.footprint import BaseOutline, Floats, PathPoses
from drivers.base.motion_fault import MotionFault
from drivers.base.progress_monitor import displacement
from drivers.base.seen_points import flaw_of

INTERVAL, MAX_INTERVAL = 1.0, 2.0
"""Shortest and longest time in seconds between two compared scans."""

MIN_WAY, MIN_TURN = 0.1, 0.25
"""Motion by odometry in metres and radians from which on two scans are compared."""

TOLERANCE, TOLERANCE_SHARE = 0.03, 0.03
"""Noise of an unchanged distance: in metres, and as a share of the distance."""

CHANGE, CHANGE_SHARE = 0.08, 0.06
"""Expected change by the motion from which on a beam is significant: in metres, and as a share of the distance."""

MIN_BEAMS, MIN_BEAMS_SHARE = 20, 0.15
"""Smallest number of significant beams, and their share of all valid beams: in a corridor few are significant."""

MIN_ANGLE = 0.7
"""Minimum angle in radians of the field of view in which scans must show the motion before they are compared.

A person who walks beside the base changes a smaller part of the scan.
"""

OWN_PARTS = 0.02
"""Distance in metres from the outline of the base within which a scanned point belongs to the robot itself."""

AGREE, DISAGREE = 0.8, 0.3
"""Share of significant beams that must fit another motion, and share that may fit the odometry."""

TURN_SHARE = 0.3
"""Minimum share of the turn by odometry that an IMU must measure, to confirm it.

If the IMU measures more than this share in the opposite direction, the turn is reversed.
"""

CONFIRMATIONS = 2
"""Number of consecutive comparisons that must contradict the odometry before a motion fault is reported."""

IMU_TURN = 0.35
"""Minimum turn by odometry in radians before it is compared with the IMU."""


@dataclass(frozen=True, slots=True)
class _Look:
    """Scan with its time, and the pose of the base by odometry at that time."""

    at: float
    pose: Pose2D
    ranges: Floats


class ScanWitness:
    """Compares scans of ``ranger``, about a second apart, with the odometry. Points within ``outline`` are ignored."""

    def __init__(self, ranger: Ranger, outline: BaseOutline) -> None:
        self._ranger, self._outline = ranger, outline
        self._looks: deque[_Look] = deque(maxlen=64)
        self._number = -1
        self._said = ""
        self._times = 0

    def restart(self) -> None:
        self._looks.clear()
        self._said, self._times = "", 0

    def compare(self, now: float, state: BaseState) -> MotionFault | None:
        """Read the newest scan; return a fault if scans contradict the odometry."""
        reading = self._ranger.scan()
        scan = reading.value
        if scan is None or not reading.good or scan.number == self._number:
            return None
        self._number = scan.number
        if flaw_of(scan) or len(scan.ranges) < MIN_BEAMS:  # the range guard reports the flaw
            return None
        bearings: Floats = scan.start + scan.step * np.arange(len(scan.ranges), dtype=np.float64)
        ranges = self._outside(scan.ranges, bearings)
        look = _Look(now, state.pose, ranges)
        while self._looks and (
            now - self._looks[0].at > MAX_INTERVAL or len(self._looks[0].ranges) != len(look.ranges)
        ):
            self._looks.popleft()
        before = next((each for each in reversed(self._looks) if now - each.at >= INTERVAL), None)
        self._looks.append(look)
        if before is None:
            return None
        said = _verdict(before, look, bearings)
        self._times = self._times + 1 if said and said == self._said else 1
        self._said = said
        if not said or self._times < CONFIRMATIONS:
            return None
        motion = displacement(before.pose, look.pose)
        how = "was commanded to move" if state.reckoned else "measures"
        believed = f"{length_text(motion.linear)} and {degrees(motion.angular):.0f} deg"
        what = f"the base {how} {believed} in {now - before.at:.1f} s, but {said}"
        return MotionFault(what, "free its wheels; check motors, encoders and their cables, and the range finder")

    def _outside(self, ranges: Ranges, bearings: Floats) -> Floats:
        """Return the distances in metres of objects outside of the robot, by beam.

        NaN for beams that hit the robot, or nothing.
        """
        far = np.where(np.isfinite(ranges), ranges, np.nan).astype(np.float64)
        ahead, left, _ = self._ranger.place
        here = PathPoses(np.zeros(1), np.zeros(1), np.zeros(1))
        clear = self._outline.clearance(ahead + far * np.cos(bearings), left + far * np.sin(bearings), here)[:, 0]
        outside: Floats = np.where(clear > OWN_PARTS, far, np.nan)
        return outside


def _verdict(before: _Look, after: _Look, bearings: Floats) -> str:
    """Return how two scans contradict the odometry between them, as text; empty if they do not."""
    motion = displacement(before.pose, after.pose)
    if abs(motion.linear) < MIN_WAY and abs(motion.angular) < MIN_TURN:
        return ""
    old, new = before.ranges, after.ranges
    expected = _predicted(old, bearings, motion.linear, motion.angular)
    opposite = _predicted(old, bearings, -motion.linear, -motion.angular)
    known = np.isfinite(old) & np.isfinite(new) & np.isfinite(expected)
    telling = known & (np.abs(expected - old) > np.maximum(CHANGE, CHANGE_SHARE * old))
    step = abs(float(bearings[-1] - bearings[0])) / max(len(bearings) - 1, 1)
    if telling.sum() < max(MIN_BEAMS, MIN_BEAMS_SHARE * known.sum(), MIN_ANGLE / step):
        return ""
    if _agreement(new, expected, telling) > DISAGREE:
        return ""
    if _agreement(new, old, telling) >= AGREE:
        return "the view of its range finder does not change: it is blocked, or its wheels slip or hang in the air"
    if _agreement(new, opposite, telling & np.isfinite(opposite)) >= AGREE:
        return "its range finder sees it move the other way: the sign of its motors is swapped"
    return ""


def _agreement(one: Floats, other: Floats, where: NDArray[np.bool_]) -> float:
    """Return the share of the beams in the mask ``where`` for which two scans have about the same distance."""
    if not where.any():
        return 0.0
    off = np.abs(one[where] - other[where])
    return float(np.mean(off <= np.maximum(TOLERANCE, TOLERANCE_SHARE * other[where])))


def _predicted(ranges: Floats, bearings: Floats, way: float, turn: float) -> Floats:
    """Return the scan that is expected after a motion of ``way`` metres and ``turn`` radians; NaN where unknown."""
    x = ranges * np.cos(bearings) - way * np.cos(turn / 2)
    y = ranges * np.sin(bearings) - way * np.sin(turn / 2)
    seen, found = np.arctan2(y, x) - turn, np.full(len(ranges), np.nan)
    step = (bearings[-1] - bearings[0]) / max(len(bearings) - 1, 1)
    known = np.isfinite(ranges)
    beams = np.round((seen[known] - bearings[0]) / step).astype(int) % len(ranges)
    far = np.hypot(x, y)[known]
    order = np.argsort(-far)  # the nearest last: it hides the others
    found[beams[order]] = far[order]
    return found


class ImuWitness:
    """Compares the turns of the base by odometry with the yaw of ``imu``."""

    def __init__(self, imu: Imu) -> None:
        self._imu = imu
        self._yaw: float | None = None
        self._turned = 0.0
        self._looks: deque[tuple[float, float, float]] = deque(maxlen=128)  # time, heading, turned by the IMU

    def restart(self) -> None:
        self._yaw = None
        self._looks.clear()

    def compare(self, now: float, state: BaseState) -> MotionFault | None:
        """Read the newest yaw; return a fault if it contradicts the turn by odometry."""
        reading = self._imu.attitude()
        if reading.value is None or not reading.good:
            self.restart()
            return None
        yaw, before = reading.value.yaw, self._yaw
        self._yaw = yaw
        self._turned += 0.0 if before is None else remainder(yaw - before, tau)
        looks = self._looks
        if not looks or now - looks[-1][0] >= INTERVAL / 20:
            looks.append((now, state.pose.heading, self._turned))
        while len(looks) > 1 and looks[1][0] <= now - INTERVAL:
            looks.popleft()
        since, heading, turned = looks[0]
        believed, felt = state.pose.heading - heading, self._turned - turned
        if now - since < INTERVAL or abs(believed) < IMU_TURN:
            return None
        side = 1.0 if believed > 0.0 else -1.0
        if side * felt > TURN_SHARE * abs(believed):
            return None
        how = "was commanded to turn by" if state.reckoned else "measures a turn of"
        said = "turns the other way: the sides of its wheels are swapped, or the IMU is mounted upside down"
        if side * felt > -TURN_SHARE * abs(believed):
            said = "does not turn: its wheels are blocked, slip or hang in the air"
        what = f"the base {how} {degrees(believed):.0f} deg in {now - since:.1f} s, but its IMU {said}"
        return MotionFault(what, "free its wheels; check motors, encoders and their cables")
