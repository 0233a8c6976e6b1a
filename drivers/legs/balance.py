"""Zero moment point of a gait and its support margins, and the balance controller of a walk."""

from dataclasses import dataclass
from math import cos, sin

import numpy as np

from drivers.legs.body import SIDES, Floats, LeggedBody
from drivers.legs.declared import StrideKeys
from drivers.legs.engine import AttitudeEstimate, BalanceCorrection, LegPosture, whole_body_pose
from drivers.legs.gait import Gait
from drivers.legs.kinematics import forward_kinematics, link_centres, rotation_about
from drivers.legs.pattern_generator import GRAVITY, FloorPose, hull_edges, pendulum_rate, polygon_margin

# Balance of a walk by the lean of the trunk: first the ankles, then the hips, then a step to the capture point.
#
# The trunk is treated as the top of an inverted pendulum: if it leans from its planned angle, the centre
# of mass is off by as much, and its capture point by more if the lean grows. The ankles correct a small error,
# within the soles; the hips take a share of a larger one; the next foot lands as far off as the
# capture point will be by then.

CAPTURE_DEADBAND = 0.012
"""Error of the capture point in metres below which the next landing is not corrected: the ankles can correct it."""


@dataclass(frozen=True, slots=True)
class BalanceGains:
    """Gains of the balance controller, from the lean of the trunk to corrections of joints and steps.

    ``ankle`` and ``hip`` are radians of joint angle per radian of lean, ``damping`` is radians per rad/s. ``step`` is
    metres of step per metre of error of the capture point. ``max_ankle`` and ``max_hip`` limit the corrections, in
    radians. In the physics engine, corrections by the ankles prevented falls. Corrections of the steps have not helped
    yet, so their gain is 0.
    """

    ankle: float = 0.3
    damping: float = 0.02
    hip: float = 0.0
    step: float = 0.0
    max_ankle: float = 0.1
    max_hip: float = 0.15


class BalanceController:
    """Balance controller of a walk. ``com_height`` is the height of the centre of mass in metres."""

    def __init__(self, stride: StrideKeys, com_height: float, gains: BalanceGains = BalanceGains()) -> None:
        self._gains, self._lean = gains, stride.lean
        self._height, self._rate = com_height, pendulum_rate(com_height)
        self._longest, self._widest = stride.longest / 2, stride.widest

    def __call__(self, felt: AttitudeEstimate, posture: LegPosture) -> BalanceCorrection:  # noqa: ARG002 - see drivers.legs.engine.BalanceFunction
        """Return the correction for the measured attitude ``felt`` in a posture."""
        gains = self._gains
        lean, rates = (felt.roll, felt.pitch - self._lean), (felt.roll_rate, felt.pitch_rate)
        pushed = [gains.ankle * angle + gains.damping * speed for angle, speed in zip(lean, rates, strict=True)]
        ankle = [_clamp(angle, gains.max_ankle) for angle in pushed]
        hip = [_clamp(-gains.hip * angle, gains.max_hip) for angle in lean]
        # A lean forwards moves the body forwards; a lean to the right (positive) to the right.
        ahead = self._capture_error(lean[1], rates[1])
        left = -self._capture_error(lean[0], rates[0])
        step = (_clamp(gains.step * ahead, self._longest), _clamp(gains.step * left, self._widest))
        return BalanceCorrection((hip[0], hip[1]), (ankle[0], ankle[1]), step)

    def _capture_error(self, lean: float, speed: float) -> float:
        """Return the error (m) of the capture point beyond the deadband."""
        error = self._height * (lean + speed / self._rate)
        return error - _clamp(error, CAPTURE_DEADBAND)


def _clamp(value: float, most: float) -> float:
    return min(max(value, -most), most)


MARGIN_CYCLES = 3
"""Number of consecutive cycles for which margins are computed: the middle one is used, without effects of the ends."""

Z = np.array([0.0, 0.0, 1.0])


def trunk_path(gait: Gait) -> Floats:
    """Return the path of the trunk (x, y, heading) over ``MARGIN_CYCLES`` cycles, with shape (M, 3).

    It is computed from the foot on the floor, which does not slip.
    """
    feet, headings, on = (np.concatenate([rows] * MARGIN_CYCLES) for rows in (gait.feet, gait.headings, gait.on_floor))
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


def support_margins(body: LeggedBody, gait: Gait, angles: Floats) -> Floats:
    """Return the distance (m) of the zero moment point inside the supporting soles; negative outside.

    One value per sample (M,).
    """
    count, trunk = len(angles), trunk_path(gait)
    placed = forward_kinematics(body, whole_body_pose(body, angles))
    trunk_mass = np.broadcast_to(body.trunk.centre, (count, 1, 3))
    masses = np.concatenate([np.concatenate((link_centres(body, placed), trunk_mass), axis=1)] * MARGIN_CYCLES)
    turned = rotation_about(Z, trunk[:, 2])
    floor = np.concatenate([gait.feet[..., 2].min(axis=1)] * MARGIN_CYCLES)  # the lower sole is on the floor
    places = (turned[:, None] @ masses[..., None])[..., 0]
    places += np.column_stack((trunk[:, :2], -floor))[:, None]
    dt = gait.period / count
    push = np.gradient(np.gradient(places, dt, axis=0), dt, axis=0)
    mass = np.append(body.mass, body.trunk.mass)
    weight = mass * (push[..., 2] + GRAVITY)
    sums = [(weight * places[..., axis] - mass * push[..., axis] * places[..., 2]).sum(axis=1) for axis in (0, 1)]
    point = np.stack(sums, axis=1) / weight.sum(axis=1)[:, None]
    middle = range(count, 2 * count)
    return np.array([_support_margin(body, gait, trunk[at], at % count, point[at]) for at in middle])


def _support_margin(body: LeggedBody, gait: Gait, trunk: Floats, at: int, point: Floats) -> float:
    """Return the distance (m) of ``point`` inside the soles that are on the floor at sample ``at``; negative outside.

    ``trunk`` (x, y, heading) is the pose of the trunk. Returns minus infinity if no foot is on the floor.
    """
    corners, here = [], FloorPose(*trunk.tolist())
    for number, side in enumerate(SIDES):
        if gait.on_floor[at, number]:
            leg, (x, y, _) = body.legs[side], gait.feet[at, number].tolist()
            sole = here.offset(x, y, float(gait.headings[at, number]))
            corners += [sole.offset(u * leg.length / 2, v * leg.width / 2).point for u in (-1, 1) for v in (-1, 1)]
    return polygon_margin(hull_edges(corners), (float(point[0]), float(point[1]))) if corners else -np.inf
