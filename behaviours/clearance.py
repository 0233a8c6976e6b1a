"""How far a base can go before it touches what its range finder sees, and how fast that may be."""

import math

from behaviours.robot import Robot
from drivers.api import BASE_RADIUS, BaseState, RangeScan

CLEARANCE_MARGIN = 0.05
"""Metres that are to stay free between its rim and anything."""

Points = list[tuple[float, float]]
"""Places: metres ahead and to the left of a base's middle."""


def scan_points(scan: RangeScan, place: tuple[float, float, float]) -> Points:
    """Return where a finder at ``place`` has seen something: as of the scan's stamp."""
    ahead, left, _ = place
    return [
        (ahead + far * math.cos(bearing), left + far * math.sin(bearing))
        for far, bearing in zip(scan.ranges.tolist(), scan.bearings().tolist(), strict=True)
        if math.isfinite(far)
    ]


def rotate_points(points: Points, angle: float) -> Points:
    """Return ``points`` as a base sees them that has turned by ``angle`` radians to the left."""
    c, s = math.cos(angle), math.sin(angle)
    return [(x * c + y * s, y * c - x * s) for x, y in points]


def free_distance(points: Points, heading: float = 0.0) -> float:
    """Return how far (m) a base can go in a ``heading`` before something is within the margin about it.

    The heading is in radians from straight ahead. Infinity where nothing is in its way. What it goes away from,
    however near, is not in its way.
    """
    c, s, reach = math.cos(heading), math.sin(heading), BASE_RADIUS + CLEARANCE_MARGIN
    way = math.inf
    for x, y in points:
        aside = c * y - s * x
        if -reach < aside < reach and (ahead := c * x + s * y) > 0.0:
            way = min(way, ahead - math.sqrt(reach * reach - aside * aside))
    return max(way, 0.0)


def safe_speed(distance: float, *, braking: float, reaction: float) -> float:
    """Return how fast (m/s) a base may go with ``way`` metres left, so that it stands before they are over.

    It goes on for ``reaction`` seconds before it brakes (at ``braking`` m/s^2), and covers v T + v^2 / 2b in all.
    """
    if math.isinf(distance):
        return math.inf
    rolled = braking * reaction
    return max(
        0.0, math.sqrt(rolled * rolled + 2 * braking * distance) - rolled
    )  # the root of a square may fall short of it


class ObstacleView:
    """What the range finder of ``robot`` sees around the base, as from where that is now."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._scan: RangeScan | None = None
        self._points: Points = []

    def points_around(self, state: BaseState, now: float) -> Points | None:
        """Return all that is seen; None while the finder does not report, and where there is none.

        A turn of the finder takes a fifth of a second: what the base has moved since its middle is worked in.
        """
        ranger = self._robot.ranger_part
        reading = None if ranger is None else ranger.scan()
        if ranger is None or reading is None or reading.value is None or not reading.good:
            return None
        scan = reading.value
        if scan is not self._scan:
            self._scan, self._points = scan, scan_points(scan, ranger.place)
        heading = self._robot.base.heading_at(scan.stamp)
        turn = 0.0 if heading is None else state.pose.heading - heading
        gone = state.velocity.linear * max(0.0, now - scan.stamp)
        return [(x - gone, y) for x, y in rotate_points(self._points, turn)]
