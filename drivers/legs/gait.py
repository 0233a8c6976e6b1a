"""Gaits: positions of the soles relative to the trunk over a cycle, made by the walking engine or from other gaits.

A gait has samples of equal duration, and repeats: the last sample is followed by the first.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from drivers.api.gait import GaitKeys
from drivers.errors import BadRequest
from drivers.legs.body import MIRROR_SIGNS, SIDES, Floats, LeggedBody
from drivers.legs.declared import StrideKeys
from drivers.legs.engine import solve_legs, solve_patterns, walk_parameters
from drivers.legs.kinematics import rotation_about
from drivers.legs.pattern_generator import WEIGHT_SHIFT_TIME, WalkPattern, WalkPatternGenerator

SAMPLES_PER_CYCLE = 100
"""Number of samples in a cycle of a generated gait, whatever the period of the cycle."""

Z = np.array([0.0, 0.0, 1.0])

SETTLING_CYCLES = 6
"""Number of cycles after which a walk has become periodic."""


@dataclass(frozen=True)
class Gait:
    """A cycle of ``period`` seconds: middles of the soles (M, 2, 3), the left one first, and their headings (M, 2).

    Both are in the frame of the trunk, which stays upright. ``on_floor`` (M, 2) marks the soles on the floor.
    """

    name: str
    period: float
    feet: Floats
    headings: Floats
    on_floor: npt.NDArray[np.bool_]

    @property
    def times(self) -> Floats:
        """Time of each sample in seconds, from 0."""
        return np.arange(len(self.feet), dtype=np.float64) * (self.period / len(self.feet))

    def angles(self, body: LeggedBody) -> tuple[Floats, npt.NDArray[np.int64]]:
        """Return the angles of the legs (M, 12), and a reason for each leg (M, 2).

        The reason is 0 or, if the leg cannot reach its foot, an index into ``UNREACHABLE_REASONS``.
        """
        return solve_legs(body, np.zeros(3), np.eye(3), self.feet, self.headings)


def gait_from_keys(keys: GaitKeys, body: LeggedBody, stride: StrideKeys) -> Gait:
    """Return the gait of a gait file, for ``body``. Raises BadRequest if it is out of reach.

    A generated walk takes settings that the file does not have from ``stride``.
    """
    if keys.walk is not None:
        walk = keys.walk
        own = {name: getattr(walk, name) for name in ("period", "double_support", "rise", "sway", "height", "feet")}
        stride = replace(stride, **{name: value for name, value in own.items() if value is not None})
        return generate_gait(keys.gait, body, stride, walk.step, walk.side, walk.turn)
    points = keys.points
    feet = np.array([[point.left, point.right] for point in points])
    headings = np.array([[point.left_turn, point.right_turn] for point in points])
    on = np.array([[point.on in (side, "both") for side in SIDES] for point in points])
    return spline_gait(keys.gait, keys.period or 0.0, np.array([point.at for point in points]), feet, headings, on)


def generate_gait(name: str, body: LeggedBody, stride: StrideKeys, step: float, side: float, turn: float) -> Gait:
    """Return the gait of a walk with steps of ``step`` metres ahead.

    Each second step also moves ``side`` metres to the left and turns by ``turn`` radians. Raises BadRequest for a step
    that is too long.
    """
    manner = walk_parameters(body, stride)
    walker = WalkPatternGenerator(manner)
    wanted = tuple(each / manner.step_time for each in (step, side / 2, turn / 2))
    given = walker.command(*wanted)
    for what, unit, one, other in zip(("step", "side", "turn"), ("m", "m", "rad"), wanted, given, strict=True):
        if abs(one - other) > 1e-9:
            far = other * manner.step_time * (1 if what == "step" else 2)
            raise BadRequest(f"{name}: {what}: a step can be {abs(far):.3g} {unit} at most", hint="check the stride")
    if not any(wanted):
        walker.velocity_command = (1e-9, 0.0, 0.0)  # on the spot
    dt = stride.period / SAMPLES_PER_CYCLE
    patterns = [
        walker.advance(dt) for _ in range(round(WEIGHT_SHIFT_TIME / dt) + (SETTLING_CYCLES + 2) * SAMPLES_PER_CYCLE)
    ]
    last = len(patterns) - 2 * SAMPLES_PER_CYCLE
    first = next(at for at in range(last, len(patterns)) if _lifts_left_foot(patterns[at - 1], patterns[at]))
    walk = solve_patterns(body, stride, patterns[first : first + SAMPLES_PER_CYCLE])
    feet = np.array([[moment.feet[each] for each in SIDES] for moment in walk.patterns])
    back = rotation_about(Z, -walk.heading)
    places = (back[:, None] @ (feet[..., :3] - walk.trunk[:, None])[..., None])[..., 0]
    on = np.array([[moment.support in (each, "both") for each in SIDES] for moment in walk.patterns])
    return Gait(name, stride.period, places, feet[..., 3] - walk.heading[:, None], on)


def _lifts_left_foot(before: WalkPattern, now: WalkPattern) -> bool:
    """True if the left foot has just been lifted."""
    return before.support == "both" and now.support == "right"


def spline_gait(
    name: str, period: float, at: Floats, feet: Floats, headings: Floats, on_floor: npt.NDArray[np.bool_]
) -> Gait:
    """Return a gait through points at shares ``at`` (P,) of its cycle, 0..1: a periodic cubic through all of them.

    A point has the positions ``feet`` and ``headings`` of both soles.
    """
    rows = np.concatenate((feet.reshape(len(at), 6), headings), axis=1)
    times = np.concatenate((at[-1:] - 1.0, at, at[:1] + 1.0))
    values = np.concatenate((rows[-1:], rows, rows[:1]))
    slopes = (values[2:] - values[:-2]) / (times[2:] - times[:-2])[:, None]
    ends, slopes = np.concatenate((rows, rows[:1])), np.concatenate((slopes, slopes[:1]))
    knots = np.append(at, at[0] + 1.0)
    shares = np.linspace(0.0, 1.0, SAMPLES_PER_CYCLE, endpoint=False)
    shares = np.where(shares < at[0], shares + 1.0, shares)
    low = np.clip(np.searchsorted(knots, shares, side="right") - 1, 0, len(at) - 1)
    long = (knots[low + 1] - knots[low])[:, None]
    s = ((shares - knots[low])[:, None]) / long
    found = (
        (1 + 2 * s) * (1 - s) ** 2 * ends[low]
        + s * (1 - s) ** 2 * long * slopes[low]
        + s**2 * (3 - 2 * s) * ends[low + 1]
        + s**2 * (s - 1) * long * slopes[low + 1]
    )
    return Gait(name, period, found[:, :6].reshape(-1, 2, 3), found[:, 6:], on_floor[low % len(at)])


def mirror_gait(gait: Gait) -> Gait:
    """Return the mirror image of a gait, with left and right swapped."""
    feet = (gait.feet * MIRROR_SIGNS)[:, ::-1]
    return replace(gait, feet=feet, headings=-gait.headings[:, ::-1], on_floor=gait.on_floor[:, ::-1])


def blend_gaits(one: Gait, other: Gait, share: float) -> Gait:
    """Return a mix of two gaits, sample by sample: ``share`` 0 is the gait ``one``, 1 is the gait ``other``."""
    return replace(
        one,
        period=(1 - share) * one.period + share * other.period,
        feet=(1 - share) * one.feet + share * other.feet,
        headings=(1 - share) * one.headings + share * other.headings,
        on_floor=one.on_floor if share < 0.5 else other.on_floor,
    )


def scale_gait(gait: Gait, *, length: float = 1.0, rise: float = 1.0, time: float = 1.0) -> Gait:
    """Return a gait with step length, foot rise and period scaled by factors."""
    low = gait.feet[..., 2].min()
    feet = gait.feet.copy()
    middle = feet.mean(axis=0)
    feet[..., :2] = middle[:, :2] + length * (feet[..., :2] - middle[:, :2])
    feet[..., 1] = gait.feet[..., 1]  # its sway keeps the balance
    feet[..., 2] = low + rise * (feet[..., 2] - low)
    return replace(gait, period=gait.period * time, feet=feet, headings=gait.headings * length)


def join_gaits(body: LeggedBody, parts: Sequence[tuple[Gait, int]], pause: float = 0.5) -> tuple[Floats, Floats]:
    """Return times (T,) and angles (T, 12) of gaits, each with its number of cycles, ``pause`` seconds apart."""
    times: list[Floats] = []
    rows: list[Floats] = []
    now = 0.0
    for gait, cycles in parts:
        angles, reason = gait.angles(body)
        if reason.any():
            raise BadRequest(f"{gait.name}: a foot is out of reach", hint=f"mission gait check {gait.name}")
        step = gait.period / len(angles)
        if rows:
            now += pause
        for _ in range(cycles):
            times.append(now + np.arange(len(angles), dtype=np.float64) * step)
            rows.append(angles)
            now += gait.period
        times.append(np.array([now]))
        rows.append(angles[:1])  # the start of the next cycle
    return np.concatenate(times), np.concatenate(rows)
