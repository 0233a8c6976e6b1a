"""Simulated range finder (lidar): it casts many rays at once, each with the result of ``SimulatedWorld.distance``."""

from collections.abc import Callable
from math import cos, inf, sin

import numpy as np

from drivers.api import Angles, Pose2D
from drivers.sim.room import Room
from drivers.sim.solids import UprightBox, UprightCylinder
from drivers.sim.world import SENSOR_HEIGHT, SimulatedWorld

RangeFunction = Callable[[Angles, float], Angles]
"""Function of bearings and a time (seconds) that returns ranges in metres from the range finder.

Bearings are of shape (n,), in radians, anticlockwise from straight ahead of the base; ranges are of shape (n,).
"""

MIN_SIDEWAYS_SHARE = 1e-12
"""Sideways part of a ray, as a share of its length, below which it counts as parallel to the side of a box."""


def make_range_function(
    world: SimulatedWorld,
    place: tuple[float, float, float],
    pose: Callable[[float], Pose2D],
    *,
    height: float = SENSOR_HEIGHT,
) -> RangeFunction:
    """Return the range function of a range finder at ``place`` (x, y in metres; yaw) on a base.

    ``pose`` returns the true pose of that base at a time. The range finder is ``height`` metres above the floor. Its
    yaw is not used: bearings are those of the base.
    """
    ahead, left, _ = place

    def look(bearings: Angles, time: float) -> Angles:
        base = pose(time)
        along, across = cos(base.heading), sin(base.heading)
        x, y = base.x + ahead * along - left * across, base.y + ahead * across + left * along
        return cast_rays(world, x, y, base.heading + bearings, time, height=height)

    return look


def cast_rays(
    world: SimulatedWorld,
    x: float,
    y: float,
    angles: Angles,
    time: float,
    *,
    height: float = SENSOR_HEIGHT,
) -> Angles:
    """Return the metres from (x, y) to the nearest solid at each of ``angles``; both arrays are of shape (n,).

    The angles are in radians in the world frame, the rays ``height`` metres above the floor.
    """
    dx, dy = np.cos(angles), np.sin(angles)
    near = _wall_distances(world.room, x, y, dx, dy)
    in_the_way = [solid for solid in world.solids(time) if solid.bottom <= height <= solid.top]
    if blocks := [solid for solid in in_the_way if isinstance(solid, UprightBox)]:
        near = np.minimum(near, _box_distances(blocks, x, y, dx, dy))
    if discs := [solid for solid in in_the_way if isinstance(solid, UprightCylinder)]:
        near = np.minimum(near, _cylinder_distances(discs, x, y, dx, dy))
    for solid in (solid for solid in in_the_way if not isinstance(solid, UprightBox | UprightCylinder)):  # one by one
        rays = (solid.intersect_ray(x, y, float(ux), float(uy)) for ux, uy in zip(dx, dy, strict=True))
        near = np.minimum(near, np.fromiter(rays, dtype=np.float64, count=len(dx)))
    return near


def _wall_distances(room: Room, x: float, y: float, dx: Angles, dy: Angles) -> Angles:
    """Return the result of ``Room.intersect_ray`` for many rays."""
    (x_low, x_high), (y_low, y_high) = room.extent()
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        across = np.where(dx == 0, inf, (np.where(dx > 0, x_high, x_low) - x) / dx)
        along = np.where(dy == 0, inf, (np.where(dy > 0, y_high, y_low) - y) / dy)
    return np.maximum(0.0, np.minimum(across, along))


def _box_distances(blocks: list[UprightBox], x: float, y: float, dx: Angles, dy: Angles) -> Angles:
    """Return the distance to the nearest of some boxes, for many rays."""
    rows = np.array([(b.x, b.y, b.cos, b.sin, b.length / 2, b.width / 2) for b in blocks])
    middle_x, middle_y, along, across, half_length, half_width = rows.T[:, :, None]
    ex, ey = x - middle_x, y - middle_y
    enter, leave = _slab_interval(ex * along + ey * across, dx * along + dy * across, half_length)
    enter_too, leave_too = _slab_interval(ey * along - ex * across, dy * along - dx * across, half_width)
    return _nearest_entry(np.maximum(enter, enter_too), np.minimum(leave, leave_too))


def _slab_interval(start: Angles, step: Angles, half: Angles) -> tuple[Angles, Angles]:
    """Return the distances at which rays enter and leave the space between two opposite sides of a box.

    All arguments are components perpendicular to these sides: ``start`` is the position of the rays' origin from the
    middle of the box, ``step`` the direction of each ray, and ``half`` half the distance between the sides.
    """
    over = 1 / np.where(np.abs(step) > MIN_SIDEWAYS_SHARE, step, MIN_SIDEWAYS_SHARE)
    middle, reach = -start * over, half * np.abs(over)
    return middle - reach, middle + reach


def _cylinder_distances(discs: list[UprightCylinder], x: float, y: float, dx: Angles, dy: Angles) -> Angles:
    """Return the distance to the nearest of some cylinders, for many rays."""
    rows = np.array([(d.x, d.y, d.radius) for d in discs])
    middle_x, middle_y, radius = rows.T[:, :, None]
    ex, ey = x - middle_x, y - middle_y
    b, c = ex * dx + ey * dy, ex * ex + ey * ey - radius * radius
    inside = b * b - c
    root = np.sqrt(np.maximum(0.0, inside))
    return _nearest_entry(np.where(inside < 0, inf, -b - root), np.where(inside < 0, -inf, -b + root))


def _nearest_entry(enter: Angles, leave: Angles) -> Angles:
    """Return for each ray the distance to the nearest of several shapes; infinity if it misses all of them.

    ``enter`` and ``leave`` have the distances at which each ray enters and leaves each shape.
    """
    hit = (enter <= leave) & (leave >= 0)
    nearest: Angles = np.where(hit, np.maximum(0.0, enter), inf).min(axis=0)
    return nearest
