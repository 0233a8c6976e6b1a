"""How far a base can go before it touches what its range finder sees, and how fast that may be."""

import math

import numpy as np
import numpy.typing as npt

from behaviours.robot import Robot
from drivers.api import BASE_RADIUS, BaseState, RangeScan

MARGIN = 0.05
"""Metres that are to stay free between its rim and anything."""

Points = npt.NDArray[np.float64]
"""Places: shape (n, 2), metres ahead and to the left of a base's middle."""


def places(scan: RangeScan, place: tuple[float, float, float]) -> Points:
    """Return where a finder at ``place`` has seen something: as of the scan's stamp."""
    seen = np.isfinite(scan.ranges)
    far, bearings = scan.ranges[seen].astype(np.float64), scan.bearings()[seen]
    found: Points = np.stack((place[0] + far * np.cos(bearings), place[1] + far * np.sin(bearings)), axis=1)
    return found


def turned(points: Points, angle: float) -> Points:
    """Return ``points`` as a base sees them that has turned by ``angle`` radians to the left."""
    c, s = math.cos(angle), math.sin(angle)
    seen: Points = points @ np.array(((c, -s), (s, c)))
    return seen


def free_way(points: Points) -> float:
    """Return how far (m) a base can go straight ahead before something is within the margin about it.

    Infinity where nothing is in its way. What it goes away from, however near, is not in its way.
    """
    return float(free_ways(points, np.zeros(1))[0])


def free_ways(points: Points, headings: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the same for several headings (radians from straight ahead): arrays of shape (n,)."""
    c, s = np.cos(headings)[:, None], np.sin(headings)[:, None]
    ahead, aside = c * points[:, 0] + s * points[:, 1], c * points[:, 1] - s * points[:, 0]
    reach = (BASE_RADIUS + MARGIN) ** 2 - aside * aside
    blocks = (ahead > 0.0) & (reach > 0.0)
    far = np.where(blocks, ahead - np.sqrt(np.maximum(reach, 0.0)), math.inf)
    least: npt.NDArray[np.float64] = far.min(axis=1, initial=math.inf)
    return np.maximum(least, 0.0)


def safe_speed(way: float, *, braking: float, reaction: float) -> float:
    """Return how fast (m/s) a base may go with ``way`` metres left, so that it stands before they are over.

    It goes on for ``reaction`` seconds before it brakes (at ``braking`` m/s^2), and covers v T + v^2 / 2b in all.
    """
    if math.isinf(way):
        return math.inf
    rolled = braking * reaction
    return max(
        0.0, math.sqrt(rolled * rolled + 2 * braking * way) - rolled
    )  # the root of a square may fall short of it


class Lookout:
    """What the range finder of ``robot`` sees around the base, as from where that is now."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._scan: RangeScan | None = None
        self._places: Points = np.empty((0, 2))

    def around(self, state: BaseState, now: float) -> Points | None:
        """Return all that is seen; None while the finder does not report, and where there is none.

        A turn of the finder takes a fifth of a second: what the base has moved since its middle is worked in.
        """
        ranger = self._robot.ranger_part
        reading = None if ranger is None else ranger.scan()
        if ranger is None or reading is None or reading.value is None or not reading.good:
            return None
        scan = reading.value
        if scan is not self._scan:
            self._scan, self._places = scan, places(scan, ranger.place)
        heading = self._robot.base.heading_at(scan.stamp)
        turn = 0.0 if heading is None else state.pose.heading - heading
        gone = state.velocity.linear * max(0.0, now - scan.stamp)
        return turned(self._places, turn) - (gone, 0.0)
