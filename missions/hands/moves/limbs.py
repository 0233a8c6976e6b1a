"""Angles of limbs out of points of a body, by the law of cosines, as fine as a servo can tell them apart."""

from collections.abc import Iterable
from math import acos, dist

Point = tuple[float, ...]
"""Where a point of a body is, in one unit of length; two or three coordinates."""

SAME = 1e-9
"""Two points that are nearer than this share of a limb's length are one: there is no angle between them."""


def angle_at(before: Point, joint: Point, behind: Point) -> float:
    """Return the angle at ``joint`` (rad), 0 where the limb is folded and pi where it is stretched.

    In a triangle, the square over one side is the sum of the other two's, less twice the product of these two sides and
    the cosine of the angle between them. Raises ValueError where ``joint`` is where one of the others is.
    """
    near, far, across = dist(joint, before), dist(joint, behind), dist(before, behind)
    if min(near, far) <= SAME * max(near, far):
        raise ValueError("two of its points are in one place")
    cosine = (near**2 + far**2 - across**2) / (2 * near * far)
    return acos(min(max(cosine, -1.0), 1.0))  # rounding may carry it past either end


def steadied(angles: Iterable[float], resolution: float) -> list[float]:
    """Return ``angles`` in which a change of less than ``resolution`` is none: the one before stands on.

    So a servo is not sent to and fro by noise that is finer than its own steps.
    """
    kept: list[float] = []
    for angle in angles:
        kept.append(angle if not kept or abs(angle - kept[-1]) >= resolution else kept[-1])
    return kept
