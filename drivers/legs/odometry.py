"""Where a body has gone by the angles of its legs: the lower foot stands still on the floor, and carries the trunk."""

from math import atan2, cos, sin

from drivers.api import Pose2D
from drivers.legs.body import SIDES, Body, Floats, Side
from drivers.legs.kinematics import forward, sole

CLEAR = 0.001
"""Metres by which the other foot must be lower to be the one that stands."""


class FootOdometry:
    """Follows the trunk from ``start`` on, over the foot that stands. It has to be told of every step."""

    def __init__(self, body: Body, start: Pose2D) -> None:
        self._body = body
        self.pose = start
        self._stands: Side = "left"
        self._anchor: tuple[float, float, float] | None = None

    def update(self, q: Floats) -> Pose2D:
        """Take a pose of all joints (N); return where the trunk is on the floor."""
        placed = forward(self._body, q)
        feet: dict[Side, tuple[float, float, float]] = {}
        lowest: dict[Side, float] = {}
        for side in SIDES:
            place, turned = sole(self._body, placed, side)
            feet[side] = float(place[0]), float(place[1]), atan2(turned[1, 0], turned[0, 0])
            lowest[side] = float(place[2])
        if self._anchor is not None:
            self.pose = _over(self._anchor, feet[self._stands])
        other: Side = "right" if self._stands == "left" else "left"
        if self._anchor is None or lowest[other] < lowest[self._stands] - CLEAR:
            self._stands = other
            self._anchor = _placed(self.pose, feet[other])
        return self.pose


def _placed(pose: Pose2D, foot: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return where a foot stands on the floor."""
    c, s = cos(pose.heading), sin(pose.heading)
    return pose.x + c * foot[0] - s * foot[1], pose.y + s * foot[0] + c * foot[1], pose.heading + foot[2]


def _over(anchor: tuple[float, float, float], foot: tuple[float, float, float]) -> Pose2D:
    """Return where the trunk is over a foot on the floor that it has there."""
    heading = anchor[2] - foot[2]
    c, s = cos(heading), sin(heading)
    return Pose2D(anchor[0] - c * foot[0] + s * foot[1], anchor[1] - s * foot[0] - c * foot[1], heading)
