"""Where a body presses on the floor in a gait: the point of zero moment of all its masses, each link a point."""

from math import cos, sin

import numpy as np

from drivers.legs.body import SIDES, Body, Floats
from drivers.legs.engine import whole
from drivers.legs.gait import Gait
from drivers.legs.kinematics import centres, forward, turning
from drivers.legs.pattern import Spot
from drivers.legs.pendulum import GRAVITY, edges, margin

CYCLES = 3
"""Cycles that are laid end to end: the middle one has whole ones on either side."""

Z = np.array([0.0, 0.0, 1.0])


def path(gait: Gait) -> Floats:
    """Return where the trunk goes over ``CYCLES`` cycles (x, y, heading), over the foot that stands: (M, 3)."""
    feet, headings, on = (np.concatenate([rows] * CYCLES) for rows in (gait.feet, gait.headings, gait.on))
    found = np.zeros((len(feet), 3))
    for at in range(1, len(feet)):
        x, y, heading = found[at - 1]
        lower = feet[at, :, 2] - 1.0 * (on[at] & on[at - 1])
        stands = int(np.argmin(lower))
        (ax, ay, _), (bx, by, _) = feet[at - 1, stands], feet[at, stands]
        turned = heading + headings[at - 1, stands] - headings[at, stands]
        c, s, ct, st = cos(heading), sin(heading), cos(turned), sin(turned)
        found[at] = x + c * ax - s * ay - ct * bx + st * by, y + s * ax + c * ay - st * bx - ct * by, turned
    return found


def margins(body: Body, gait: Gait, angles: Floats) -> Floats:
    """Return how far (m) within the soles on the floor it presses at each moment (M,); below 0 outside of them."""
    count, trunk = len(angles), path(gait)
    placed = forward(body, whole(body, angles))
    trunk_mass = np.broadcast_to(body.trunk.centre, (count, 1, 3))
    masses = np.concatenate([np.concatenate((centres(body, placed), trunk_mass), axis=1)] * CYCLES)
    turned = turning(Z, trunk[:, 2])
    floor = np.concatenate([gait.feet[..., 2].min(axis=1)] * CYCLES)  # the lower sole is on the floor
    places = (turned[:, None] @ masses[..., None])[..., 0]
    places += np.column_stack((trunk[:, :2], -floor))[:, None]
    dt = gait.period / count
    push = np.gradient(np.gradient(places, dt, axis=0), dt, axis=0)
    mass = np.append(body.mass, body.trunk.mass)
    weight = mass * (push[..., 2] + GRAVITY)
    sums = [(weight * places[..., axis] - mass * push[..., axis] * places[..., 2]).sum(axis=1) for axis in (0, 1)]
    point = np.stack(sums, axis=1) / weight.sum(axis=1)[:, None]
    middle = range(count, 2 * count)
    return np.array([_margin(body, gait, trunk[at], at % count, point[at]) for at in middle])


def _margin(body: Body, gait: Gait, trunk: Floats, at: int, point: Floats) -> float:
    """Return the margin of one moment; minus infinity where no foot is on the floor."""
    corners, here = [], Spot(*trunk.tolist())
    for number, side in enumerate(SIDES):
        if gait.on[at, number]:
            leg, (x, y, _) = body.legs[side], gait.feet[at, number].tolist()
            sole = here.beside(x, y, float(gait.headings[at, number]))
            corners += [sole.beside(u * leg.length / 2, v * leg.width / 2).point for u in (-1, 1) for v in (-1, 1)]
    return margin(edges(corners), (float(point[0]), float(point[1]))) if corners else -np.inf
