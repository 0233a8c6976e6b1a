"""Inverse kinematics of arms, in closed form: the angles that bring a hand, the end of the last link, to a place.

Two kinds of arms have one. ``y x x``: the elbow is parallel to the shoulder's roll (OP3); the hand keeps its distance
from the plane across the pitch axis, and shoulder and elbow are a triangle in it. ``y x y``, or ``y x z y`` with a
twist between: the shoulder's axes meet, so that the elbow alone says how far the hand is. A plane is one of complex
numbers: y + iz turns by exp(ia) about x, z + ix about y. The right arm is solved as the left one in a mirror.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.errors import BadRequest
from drivers.legs.body import FLIPPED, Body, Floats, Side
from drivers.legs.kinematics import Placed
from drivers.legs.leg_ik import SLACK, Solution, wrapped

ARM_REASONS = (
    "",
    "the hand is too far from the shoulder",
    "the hand is too near to the shoulder",
    "the hand is too near to the axis of the shoulder's pitch, or too far along it",
    "the shoulder's angles are not determined: the hand lies on an axis",
    "not a finite place, or twist",
    "a joint would be beyond its limits",
)
"""Why a place of a hand cannot be reached, or in which way angles are not determined."""

DEGENERATE = 1e-9
"""Metres from an axis below which the angle about it is not determined."""

WAYS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
"""The four solutions: which way the shoulder turns, and which way the elbow bends."""

Planar = npt.NDArray[np.complex128]
Reason = npt.NDArray[np.int64]


@dataclass(frozen=True)
class _Arm:
    """A left arm in figures: offsets of roll, twist, elbow and hand, each from the joint before it; twist may be 0."""

    pitch: Floats
    roll: Floats
    upper: Floats
    elbow: Floats
    hand: Floats


def hand(body: Body, placed: Placed, side: Side) -> Floats:
    """Return where a hand is (..., 3), in the frame of the trunk."""
    last = body.arms[side][-1]
    found: Floats = placed.position[..., last, :] + placed.rotation[..., last, :, :] @ body.end[last]
    return found


def solve_arm(body: Body, side: Side, place: Floats, twist: Floats | float = 0.0) -> Solution:
    """Return the angles (..., 4, J) of an arm's J joints that bring its hand to ``place`` (..., 3).

    That is in the frame of the trunk. The four are those of ``WAYS``. An arm of four joints has its third one, the
    ``twist`` (...), as it is asked. Where there are none, the reason (..., 4) is one of ``ARM_REASONS`` and the angles
    are NaN. Raises BadRequest for an arm without a closed form.
    """
    joints = list(body.arms["left"])
    sign, solver = body.axis[joints].sum(axis=-1), _solver(body, joints)
    place = np.asarray(place, np.float64)
    if side == "right":
        place, sign = place * FLIPPED, sign * body.sign[joints]
    *first, last = (body.offset[joint] for joint in joints)
    upper = first[2] if len(joints) == 4 else np.zeros(3)
    arm = _Arm(first[0], first[1], upper, last, body.end[joints[-1]])
    asked = np.asarray(twist, np.float64)[..., None]
    asked = asked * sign[2] if len(joints) == 4 else np.zeros_like(asked)
    finite = np.isfinite(place).all(axis=-1, keepdims=True) & np.isfinite(asked)
    shoulder, elbow = WAYS.T
    with np.errstate(invalid="ignore", divide="ignore"):
        found = solver(arm, (place - arm.pitch)[..., None, :], asked, shoulder, elbow)
    pitch, roll, bend, reason = found
    reason = np.where(finite, reason, 5)
    rows = [pitch, roll, np.where(finite, asked, np.nan) + np.zeros(reason.shape), bend]
    angles = wrapped(np.stack([row for row in rows if len(joints) == 4 or row is not rows[2]], axis=-1)) * sign
    return Solution(np.where((reason == 0)[..., None], angles, np.nan), reason)


def within(found: Solution, low: Floats, high: Floats) -> Solution:
    """Return of four solutions the one (..., J) within limits (J), that of the smallest angles if there are several.

    Its reason says why there is none.
    """
    kept = found.reachable & ((found.angles >= low) & (found.angles <= high)).all(axis=-1)
    size = np.where(kept, np.abs(found.angles).max(axis=-1), np.inf)
    best = size.argmin(axis=-1)[..., None]
    angles = np.take_along_axis(found.angles, best[..., None], axis=-2)[..., 0, :]
    reason = np.where(kept.any(axis=-1), 0, np.where(found.reachable.any(axis=-1), 6, found.reason.min(axis=-1)))
    return Solution(np.where((reason == 0)[..., None], angles, np.nan), reason)


Found = tuple[Floats, Floats, Floats, Reason]
Solver = Callable[[_Arm, Floats, Floats, Floats, Floats], Found]


def _solver(body: Body, joints: list[int]) -> Solver:
    """Return what solves such an arm. Raises BadRequest where nothing does."""
    turns = "".join("xyz"[int(np.abs(body.axis[joint]).argmax())] for joint in joints)
    if turns == "yxx":
        return _parallel
    offsets = [body.offset[joint] for joint in joints]
    along = [offsets[1][[0, 2]], *([offsets[2][[0, 1]]] if turns == "yxzy" else [])]
    if turns in ("yxy", "yxzy") and not np.abs(np.concatenate(along)).max() > SLACK:
        return _meeting
    names = ", ".join(f"{body.joints[joint]} ({axis})" for joint, axis in zip(joints, turns, strict=True))
    hint = "arms that have them turn about y x x; or y x y or y x z y, where the axes of pitch, roll and twist meet"
    raise BadRequest(f"base: the arm {names} has no angles in closed form", hint=hint)


def _parallel(arm: _Arm, seen: Floats, twist: Floats, shoulder: Floats, elbow: Floats) -> Found:
    """Solve y x x: ``seen`` is the hand from a point of the pitch axis."""
    del twist
    x, y, z = np.moveaxis(seen, -1, 0)
    out = float(arm.roll[0] + arm.elbow[0] + arm.hand[0])  # no roll changes it
    across = np.sqrt(np.maximum(x * x + z * z - out * out, 0.0)) * shoulder
    thigh, shank = complex(*arm.elbow[1:]), complex(*arm.hand[1:])
    reach: Planar = y + 1j * across - complex(*arm.roll[1:])
    bend, short = _bent(thigh, shank, np.abs(reach), elbow)
    roll = np.angle(reach) - np.angle(thigh + shank * np.exp(1j * bend))
    flat = np.hypot(x, z) + 0.0 * shoulder
    vague = (flat < DEGENERATE) | (np.abs(reach) < DEGENERATE)
    pitch = np.angle(z + 1j * x) - np.angle(across + 1j * out)
    return pitch, roll, bend, np.where(vague, 4, np.where(flat < abs(out) - SLACK, 3, short))


def _meeting(arm: _Arm, seen: Floats, twist: Floats, shoulder: Floats, elbow: Floats) -> Found:
    """Solve y x y and y x z y."""
    x, y, z = np.moveaxis(seen - arm.roll, -1, 0)
    upper, aside = arm.upper + arm.elbow, float(arm.upper[1] + arm.elbow[1] + arm.hand[1])
    thigh, shank = complex(upper[2], upper[0]), complex(arm.hand[2], arm.hand[0])
    far = np.sqrt(x * x + y * y + z * z)
    bend, short = _bent(thigh, shank, np.sqrt(np.maximum(far * far - aside * aside, 0.0)), elbow)
    bent: Planar = thigh + shank * np.exp(1j * bend)
    c, s = np.cos(twist), np.sin(twist)
    ahead, left = c * bent.imag - s * aside, s * bent.imag + c * aside
    hung: Planar = left + 1j * bent.real
    off = y / np.abs(hung)
    roll = shoulder * np.arccos(np.clip(off, -1.0, 1.0)) - np.angle(hung)
    up = (hung * np.exp(1j * roll)).imag
    vague = (np.abs(hung) < DEGENERATE) | (np.hypot(x, z) + 0.0 * up < DEGENERATE)
    pitch = np.angle(z + 1j * x) - np.angle(up + 1j * ahead)
    reason = np.where(short > 0, short, np.where(vague, 4, np.where(np.abs(off) > 1.0 + SLACK, 3, 0)))
    return pitch, roll, bend, reason


def _bent(thigh: complex, shank: complex, far: Floats, way: Floats) -> tuple[Floats, Reason]:
    """Return by how much the second of two links turns for their end to be ``far`` away, and why it cannot."""
    a, b = abs(thigh), abs(shank)
    short = np.where(far > a + b + SLACK, 1, np.where((far < abs(a - b) - SLACK) | (far < SLACK), 2, 0))
    apart = way * np.arccos(np.clip((far * far - a * a - b * b) / (2 * a * b), -1.0, 1.0))
    return apart + float(np.angle(thigh) - np.angle(shank)), short + np.zeros_like(apart, np.int64)
