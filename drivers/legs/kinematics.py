"""Forward kinematics of a body, its centre of mass and Jacobians: for one pose or for many at once.

``q`` are angles (..., N) in the order of ``Body.joints``. All places are in the frame of the trunk.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import atan2, cos, sin

import numpy as np

from drivers.api import Pose2D
from drivers.legs.body import FLIPPED, SIDES, Body, Floats, Side

IDENTITY = np.eye(3)


@dataclass(frozen=True)
class Placed:
    """Where the links are: their origins (..., N, 3), and their orientations (..., N, 3, 3)."""

    position: Floats
    rotation: Floats


def turning(axis: Floats, angle: Floats) -> Floats:
    """Return the rotations (..., 3, 3) about a unit ``axis`` by angles (...): Rodrigues' formula."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.asarray(angle, dtype=np.float64)[..., None, None]
    turned: Floats = IDENTITY + np.sin(angle) * across + (1.0 - np.cos(angle)) * (across @ across)
    return turned


def forward(body: Body, q: Floats) -> Placed:
    """Return where every link is in poses ``q`` (..., N)."""
    shape = q.shape[:-1]
    position = np.empty((*shape, len(body.joints), 3))
    rotation = np.empty((*shape, len(body.joints), 3, 3))
    for place, parent in enumerate(body.parent):
        turned = turning(body.axis[place], q[..., place])
        if parent < 0:
            position[..., place, :] = body.offset[place]
            rotation[..., place, :, :] = turned
        else:
            carrier = rotation[..., parent, :, :]
            position[..., place, :] = position[..., parent, :] + carrier @ body.offset[place]
            rotation[..., place, :, :] = carrier @ turned
    return Placed(position, rotation)


def sole(body: Body, placed: Placed, side: Side) -> tuple[Floats, Floats]:
    """Return the middle of a sole (..., 3) and its orientation (..., 3, 3)."""
    leg = body.legs[side]
    last = leg.joints[-1]
    rotation = placed.rotation[..., last, :, :]
    return placed.position[..., last, :] + rotation @ leg.sole, rotation


def centres(body: Body, placed: Placed) -> Floats:
    """Return the centre of mass of every link (..., N, 3)."""
    found: Floats = placed.position + (placed.rotation @ body.centre[:, :, None])[..., 0]
    return found


def centre_of_mass(body: Body, placed: Placed) -> Floats:
    """Return the centre of mass of the whole body (..., 3)."""
    weighed = (body.mass[:, None] * centres(body, placed)).sum(axis=-2)
    found: Floats = (weighed + body.trunk.mass * body.trunk.centre) / body.total
    return found


def above(body: Body, link: int) -> list[int]:
    """Return the joints that move a link: its own, and those that carry it."""
    found = []
    while link >= 0:
        found.append(link)
        link = body.parent[link]
    return found[::-1]


def axes(body: Body, placed: Placed) -> Floats:
    """Return the axes of the joints (..., N, 3) as they are turned."""
    found: Floats = (placed.rotation @ body.axis[:, :, None])[..., 0]
    return found


def jacobian(body: Body, placed: Placed, link: int, point: Floats) -> Floats:
    """Return how a ``point`` (3) of a link, in its frame, moves: (..., 6, N), linear over angular, a joint a column."""
    turned = axes(body, placed)
    there = placed.position[..., link, :] + placed.rotation[..., link, :, :] @ point
    found = np.zeros((*turned.shape[:-2], 6, len(body.joints)))
    for joint in above(body, link):
        axis = turned[..., joint, :]
        found[..., :3, joint] = np.cross(axis, there - placed.position[..., joint, :])
        found[..., 3:, joint] = axis
    return found


def centre_jacobian(body: Body, placed: Placed) -> Floats:
    """Return how the centre of mass moves: (..., 3, N)."""
    turned, masses = axes(body, placed), centres(body, placed)
    found = np.zeros((*turned.shape[:-2], 3, len(body.joints)))
    for link in range(len(body.joints)):
        for joint in above(body, link):
            arm = masses[..., link, :] - placed.position[..., joint, :]
            found[..., joint] += body.mass[link] / body.total * np.cross(turned[..., joint, :], arm)
    return found


@dataclass(frozen=True)
class _Masses:
    """What legs weigh, and ``still`` all but them: mass times place.

    Of each joint of the left one: the number and the sign of its axis, its offset, its mass and the centre of that.
    """

    still: Floats
    total: float
    joints: tuple[tuple[int, float, Floats, float, Floats], ...]
    right: Floats


@lru_cache(maxsize=16)
def _masses(body: Body) -> _Masses:
    rest = forward(body, np.zeros(len(body.joints)))
    mass = body.mass.copy()
    mass[body.leg_places] = 0.0
    still = (mass[:, None] * centres(body, rest)).sum(axis=0) + body.trunk.mass * body.trunk.centre
    leg = body.legs["left"].joints
    joints = tuple(
        (int(np.abs(body.axis[j]).argmax()), body.axis[j].sum(), body.offset[j], body.mass[j], body.centre[j])
        for j in leg
    )
    return _Masses(still, body.total, joints, np.stack((np.ones(6), body.sign[list(leg)])))


def centre_over_legs(body: Body, angles: Floats) -> Floats:
    """Return the centre of mass (..., 3) with the legs at ``angles`` (..., 2, 6) and all else at 0: of one that walks.

    The same as ``centre_of_mass``, in a tenth of the time.
    """
    masses = _masses(body)
    turned = angles * masses.right
    columns = [np.broadcast_to(axis, (*turned.shape[:-1], 3)) for axis in IDENTITY]
    place, sum_ = np.zeros(3), np.zeros(3)
    for joint, (axis, sign, offset, mass, centre) in enumerate(masses.joints):
        place = place + _along(columns, offset)
        c, s = np.cos(turned[..., joint, None]), sign * np.sin(turned[..., joint, None])
        one, other = (axis + 1) % 3, (axis + 2) % 3
        columns[one], columns[other] = (
            c * columns[one] + s * columns[other],
            c * columns[other] - s * columns[one],
        )
        sum_ = sum_ + mass * (place + _along(columns, centre))
    found: Floats = (masses.still + sum_[..., 0, :] + sum_[..., 1, :] * FLIPPED) / masses.total
    return found


def _along(columns: Sequence[Floats], way: Floats) -> Floats:
    """Return a way of a link's frame along the columns of its rotation."""
    found = np.zeros(3)
    for part, column in zip(way.tolist(), columns, strict=True):
        if part:
            found = found + part * column
    return found


# Where a body has gone by the angles of its legs: the lower foot stands still on the floor, and carries the trunk.

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
