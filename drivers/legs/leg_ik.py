"""Inverse kinematics of legs, in closed form.

The axes of hip turn and hip roll meet in a point, and so do those of ankle pitch and ankle roll; the three pitch axes
are parallel. Seen from the foot, the position of the hip determines the ankle's roll. The orientation determines the
hip's turn and roll, and the sum of the pitches. The rest is a triangle of thigh and shank. Offsets within the plane of
the leg, and between hip and foot across it, are supported. The right leg is solved as a mirrored left one.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from drivers.legs.body import MIRROR_SIGNS, Floats, LeggedBody, Side

UNREACHABLE_REASONS = (
    "",
    "the foot is too far from the hip",
    "the foot is too near to the hip",
    "the foot is too near to the axis of the lateral offset between hip and foot",
    "the hip turn is undetermined: the leg points out to the side",
    "not a finite pose",
)
"""Reasons why a pose of a foot is unreachable or not determined."""

LENGTH_SLACK = 1e-12
"""Metres by which a leg may be too short and still reach its foot, to tolerate rounding errors."""

MIN_ROLL_COSINE = 1e-7
"""Cosine of the hip's roll below which its turn is not determined."""


@dataclass(frozen=True)
class LegSolution:
    """Angles (..., 6) of a leg, hip turn first; ``reason`` (...) is 0, or an index into ``UNREACHABLE_REASONS``."""

    angles: Floats
    reason: npt.NDArray[np.int64]

    @property
    def is_reachable(self) -> npt.NDArray[np.bool_]:
        """Whether the leg can reach each pose of the foot: shape (...)."""
        return np.equal(self.reason, 0)


@dataclass(frozen=True)
class _LegShape:
    """Geometry of the left leg: signs of its six axes, points where axes meet, and lengths in the plane of the leg."""

    sign: Floats
    right: Floats  # signs of the right leg's angles relative to the left
    hip: Floats  # intersection of the turn and roll axes, from the trunk
    hang: Floats  # from there to the axis of the hip's pitch, in the plane: (x, z)
    thigh: Floats  # (x, z)
    shank: Floats  # (x, z)
    across: float  # offset of the ankle to the left of the hip
    ankle: Floats  # intersection of the pitch and roll axes, from the sole's middle, in the foot's frame


def solve_leg(body: LeggedBody, side: Side, position: Floats, rotation: Floats) -> LegSolution:
    """Return the angles that bring the middle of a sole to ``position`` (..., 3) with ``rotation`` (..., 3, 3).

    Both are in the frame of the trunk. The knee bends forward. For an unreachable pose, the reason is set and the
    angles are NaN.
    """
    shape = leg_shape(body)
    position, rotation = np.asarray(position, np.float64), np.asarray(rotation, np.float64)
    if side == "left":
        return _solve(shape, position, rotation, shape.sign)
    return _solve(shape, position * MIRROR_SIGNS, rotation * MIRROR_ROTATION, shape.sign * shape.right)


def solve_both_legs(body: LeggedBody, position: Floats, rotation: Floats) -> LegSolution:
    """Solve both legs, left first: ``position`` (..., 2, 3), ``rotation`` (..., 2, 3, 3); angles (..., 2, 6)."""
    shape = leg_shape(body)
    sign = np.stack((shape.sign, shape.sign * shape.right))
    return _solve(shape, position * BOTH_SIGNS, rotation * BOTH_MIRRORS, sign)


MIRROR_ROTATION = np.outer(MIRROR_SIGNS, MIRROR_SIGNS)
BOTH_SIGNS = np.stack((np.ones(3), MIRROR_SIGNS))
BOTH_MIRRORS = np.stack((np.ones((3, 3)), MIRROR_ROTATION))


def _solve(shape: _LegShape, position: Floats, rotation: Floats, sign: Floats) -> LegSolution:
    finite = np.isfinite(position).all(-1) & np.isfinite(rotation).all((-2, -1))
    # The hip, seen from the ankle along the axes of the foot.
    hip = ((shape.hip - position)[..., :, None] * rotation).sum(-2) - shape.ankle
    with np.errstate(invalid="ignore", divide="ignore"):
        roll, beyond = _ankle_roll(hip, shape.across)
        cr, sr = np.cos(roll), np.sin(roll)
        # Columns of the rotation without the ankle's roll: a turn about z, a roll about x, and the pitches about y.
        second, third = rotation[..., :, 1], rotation[..., :, 2]
        y_axis = second * cr[..., None] - third * sr[..., None]
        up = rotation[..., 2, 1] * sr + rotation[..., 2, 2] * cr
        flat = np.hypot(y_axis[..., 0], y_axis[..., 1])
        hip_roll = np.arctan2(y_axis[..., 2], flat)
        turn = np.arctan2(-y_axis[..., 0], y_axis[..., 1])
        pitch = np.arctan2(-rotation[..., 2, 0], up)
        hip_pitch, bend, short = _triangle(shape, hip[..., 0], hip[..., 1] * sr + hip[..., 2] * cr, pitch)
    reason = np.where(~finite, 5, np.where(beyond, 3, np.where(flat < MIN_ROLL_COSINE, 4, short)))
    pitches = wrap_angles(np.stack((hip_pitch, bend, pitch - hip_pitch - bend, roll), axis=-1))
    angles = np.concatenate((turn[..., None], hip_roll[..., None], pitches), axis=-1) * sign
    return LegSolution(np.where((reason == 0)[..., None], angles, np.nan), reason)


def _ankle_roll(hip: Floats, across: float) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Return the ankle's roll about +x, and where it has no solution.

    ``hip`` (..., 3) is the position of the hip in the frame of the foot; the roll must bring it to y = ``-across``.
    """
    y, z = hip[..., 1], hip[..., 2]
    far = np.hypot(y, z)
    beyond = far <= abs(across) + LENGTH_SLACK
    # In the frame before the roll the hip lies at y' = y cos - z sin = -across.
    roll = np.arctan2(y, z) + np.arcsin(np.clip(across / np.where(beyond, 1.0, far), -1.0, 1.0))
    return roll, beyond


def _triangle(
    shape: _LegShape, ahead: Floats, up: Floats, pitch: Floats
) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """Return the pitch of hip and knee about +y, and the index of the reason if there is no solution.

    ``ahead`` and ``up`` are the position of the hip from the ankle, in the plane of the leg, along the axes of the
    foot. ``pitch`` is the sum of the pitches of hip, knee and ankle.
    """
    thigh, shank = shape.thigh, shape.shank
    a, b = float(np.hypot(*thigh)), float(np.hypot(*shank))
    c, s = np.cos(pitch), np.sin(pitch)
    # From the hip's pitch axis to the ankle, along the axes of the hip.
    x = -(c * ahead + s * up) - shape.hang[0]
    z = s * ahead - c * up - shape.hang[1]
    far = np.hypot(x, z)
    short = np.where(
        far > a + b + LENGTH_SLACK, 1, np.where((far < abs(a - b) - LENGTH_SLACK) | (far < LENGTH_SLACK), 2, 0)
    )
    apart = np.arccos(np.clip((far * far - a * a - b * b) / (2 * a * b), -1.0, 1.0))
    bend = apart - (_bearing(shank) - _bearing(thigh))
    cb, sb = np.cos(bend), np.sin(bend)
    whole = np.stack((thigh[0] + cb * shank[0] + sb * shank[1], thigh[1] - sb * shank[0] + cb * shank[1]), axis=-1)
    return np.arctan2(x, z) - _bearing(whole), bend, short


def _bearing(way: Floats) -> Floats:
    """Return the angle of vectors ``way`` (..., 2), with components x and z, from z; positive as a turn about +y."""
    found: Floats = np.arctan2(way[..., 0], way[..., 1])
    return found


def wrap_angles(angle: Floats) -> Floats:
    """Return angles (radians) within one turn: above -pi, up to pi."""
    found: Floats = np.pi - np.mod(np.pi - angle, 2 * np.pi)
    return found


@lru_cache(maxsize=16)
def leg_shape(body: LeggedBody) -> _LegShape:
    """Return the geometry of the left leg."""
    joints = list(body.legs["left"].joints)
    turn, roll, pitch, knee, ankle, last = (body.offset[joint] for joint in joints)
    hang = np.array([roll[0], 0.0, 0.0]) + pitch
    return _LegShape(
        sign=body.axis[joints].sum(axis=-1),
        right=body.sign[joints],
        hip=turn + np.array([0.0, 0.0, roll[2]]),
        hang=hang[[0, 2]],
        thigh=knee[[0, 2]],
        shank=ankle[[0, 2]],
        across=float(hang[1] + knee[1] + ankle[1] + last[1]),
        ankle=np.array([-last[0], 0.0, 0.0]) - body.legs["left"].sole,
    )
