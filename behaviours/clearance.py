"""Free distance of a base before its rim touches an obstacle that the range finder sees, and the safe speed for it."""

import math

from behaviours.robot import Robot
from drivers.api import BASE_RADIUS, BaseState, RangeScan

CLEARANCE_MARGIN = 0.05
"""Metres to keep free between the base's rim and obstacles."""

Points = list[tuple[float, float]]
"""Points in metres ahead and to the left of the base's middle."""


def scan_points(scan: RangeScan, place: tuple[float, float, float]) -> Points:
    """Return the points of a scan, for a range finder at ``place`` (x, y, heading), at the time of the scan."""
    ahead, left, _ = place
    return [
        (ahead + distance * math.cos(bearing), left + distance * math.sin(bearing))
        for distance, bearing in zip(scan.ranges.tolist(), scan.bearings().tolist(), strict=True)
        if math.isfinite(distance)
    ]


def rotate_points(points: Points, angle: float) -> Points:
    """Return ``points`` as seen by the base after it has turned left by ``angle`` radians."""
    c, s = math.cos(angle), math.sin(angle)
    return [(x * c + y * s, y * c - x * s) for x, y in points]


def free_distance(points: Points, heading: float = 0.0) -> float:
    """Return the distance (m) that a base can drive along ``heading`` before its rim is near one of ``points``.

    "Near" is closer than CLEARANCE_MARGIN. The heading is in radians from straight ahead. Returns infinity if nothing
    is in the way. Obstacles behind the base do not count, however close they are.
    """
    c, s, reach = math.cos(heading), math.sin(heading), BASE_RADIUS + CLEARANCE_MARGIN
    way = math.inf
    for x, y in points:
        aside = c * y - s * x
        if -reach < aside < reach and (ahead := c * x + s * y) > 0.0:
            way = min(way, ahead - math.sqrt(reach * reach - aside * aside))
    return max(way, 0.0)


def safe_speed(distance: float, *, braking: float, reaction: float) -> float:
    """Return the speed (m/s) from which a base can stop within ``distance`` metres.

    The base rolls on for ``reaction`` seconds, then brakes at ``braking`` m/s^2, so it covers v T + v^2 / 2b in all.
    """
    if math.isinf(distance):
        return math.inf
    rolled = braking * reaction
    return max(
        0.0, math.sqrt(rolled * rolled + 2 * braking * distance) - rolled
    )  # the root of a square may fall short of it


class ObstacleView:
    """Obstacles around the base as seen by the range finder, corrected for the base's motion since the scan."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._scan: RangeScan | None = None
        self._points: Points = []

    def points_around(self, state: BaseState, now: float) -> Points | None:
        """Return the points of the newest scan, or None without a range finder or while it does not report.

        A scan takes a fifth of a second, so the base's motion since the middle of the scan is compensated.
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
        moved = state.velocity.linear * max(0.0, now - scan.stamp)
        return [(x - moved, y) for x, y in rotate_points(self._points, turn)]
