"""Where a body presses on the floor in a gait: the point of zero moment of all its masses, each link a point."""

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from drivers.legs.body import SIDES, Body, Floats
from drivers.legs.declared import StrideKeys
from drivers.legs.engine import Correction, Felt, Posture, whole
from drivers.legs.gait import Gait
from drivers.legs.kinematics import centres, forward, turning
from drivers.legs.walker import GRAVITY, Spot, edges, margin, rate

# Balance of a walk by what is felt of the trunk: ankles first, then the hips, then a step to where it can be caught.
#
# The trunk is taken for the top of an inverted pendulum: leaning by an angle from where the walk has it, the centre
# of mass is that far off, and its capture point farther by how fast the lean grows. A small error the ankles push
# back, as far as the soles reach; of a larger one the hips take a share; the next foot lands as far off as the
# capture point will be by then.

DEAD = 0.012
"""Metres of capture error that soles take by themselves."""


@dataclass(frozen=True, slots=True)
class Gains:
    """How much balance does: ``ankle`` and ``hip`` per radian of lean, ``damping`` per rad/s, ``step`` of the error.

    In physics the ankles kept walks up that fell without them; steps have not been seen to help yet, and are off.
    """

    ankle: float = 0.3
    damping: float = 0.02
    hip: float = 0.0
    step: float = 0.0
    most_ankle: float = 0.1
    most_hip: float = 0.15


class Balance:
    """Says what is to be added to a walk. ``com_height`` is that of the centre of mass in metres."""

    def __init__(self, stride: StrideKeys, com_height: float, gains: Gains = Gains()) -> None:
        self._gains, self._lean = gains, stride.lean
        self._height, self._rate = com_height, rate(com_height)
        self._longest, self._widest = stride.longest / 2, stride.widest

    def __call__(self, felt: Felt, posture: Posture) -> Correction:  # noqa: ARG002 - see drivers.legs.engine.Balance
        """Return the correction for what is felt in a posture."""
        gains = self._gains
        lean, rates = (felt.roll, felt.pitch - self._lean), (felt.roll_rate, felt.pitch_rate)
        pushed = [gains.ankle * angle + gains.damping * speed for angle, speed in zip(lean, rates, strict=True)]
        ankle = [_within(angle, gains.most_ankle) for angle in pushed]
        hip = [_within(-gains.hip * angle, gains.most_hip) for angle in lean]
        # A lean ahead carries the body ahead; a lean to the right, which is above 0, to the right.
        ahead = self._error(lean[1], rates[1])
        left = -self._error(lean[0], rates[0])
        step = (_within(gains.step * ahead, self._longest), _within(gains.step * left, self._widest))
        return Correction((hip[0], hip[1]), (ankle[0], ankle[1]), step)

    def _error(self, lean: float, speed: float) -> float:
        """Return how far (m) the capture point is off, beyond what soles take by themselves."""
        error = self._height * (lean + speed / self._rate)
        return error - _within(error, DEAD)


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)


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
