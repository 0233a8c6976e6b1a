"""From the pattern of a walk to the angles of the legs, 100 times a second: the walking engine, without any clock."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from math import cos, sin

import numpy as np
import numpy.typing as npt

from drivers.api.measures import length_text
from drivers.errors import BadRequest
from drivers.legs.body import SIDES, Floats, LeggedBody
from drivers.legs.declared import StrideKeys
from drivers.legs.kinematics import centre_over_legs, forward_kinematics, rotation_about, sole_pose
from drivers.legs.leg_ik import UNREACHABLE_REASONS, solve_both_legs
from drivers.legs.pattern_generator import FloorPose, WalkParameters, WalkPattern, WalkPatternGenerator, sole_inset

CONTROL_INTERVAL = 0.01
"""Seconds from one posture to the next."""

FADE_TIME = 0.5
"""Seconds in which what the balance has added fades, once nothing measures how the trunk leans."""

MIN_COM_HEIGHT = 0.05
"""Metres above the soles below which no centre of mass of a body that stands can be."""

_, Y, Z = np.eye(3)

STAND_ITERATIONS = 2
"""How often a stand is moved until its centre of mass is over the middle of the soles."""


@dataclass(frozen=True, slots=True)
class AttitudeEstimate:
    """What is felt of the trunk: its roll and pitch (radians from upright), and how fast they change (rad/s).

    ``pressure`` is the point of pressure from the middle between both feet (m), where soles measure it.
    """

    roll: float
    pitch: float
    roll_rate: float = 0.0
    pitch_rate: float = 0.0
    pressure: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class BalanceCorrection:
    """What who keeps the balance adds: to the trunk's roll and pitch, to both ankles (radians), to the next landing.

    ``step`` are metres ahead and to the left, ``down`` metres by which the trunk sinks.
    """

    hip: tuple[float, float] = (0.0, 0.0)
    ankle: tuple[float, float] = (0.0, 0.0)
    step: tuple[float, float] = (0.0, 0.0)
    down: float = 0.0

    def fade(self, dt: float) -> "BalanceCorrection":
        """Return what is left of it after ``dt`` seconds without a measurement."""
        left = max(0.0, 1.0 - dt / FADE_TIME)
        (roll, pitch), (one, other) = self.hip, self.ankle
        return BalanceCorrection((left * roll, left * pitch), (left * one, left * other), (0.0, 0.0), left * self.down)


@dataclass(frozen=True, slots=True)
class LegPosture:
    """Where the legs are to be: ``angles`` (12,) in the order of ``Body.walking``, and the pattern that they follow.

    ``refused`` says why a foot cannot be where the pattern wants it; its leg stays as it was then.
    """

    angles: Floats
    pattern: WalkPattern
    refused: str = ""


@dataclass(frozen=True)
class WalkPlan:
    """A stretch of a walk, M moments: ``angles`` (M, 12), ``trunk`` (M, 3), ``heading`` (M,), ``reason`` (M, 2)."""

    times: Floats
    patterns: tuple[WalkPattern, ...]
    angles: Floats
    trunk: Floats
    heading: Floats
    reason: npt.NDArray[np.int64] = field(repr=False)


BalanceFunction = Callable[[AttitudeEstimate, LegPosture], BalanceCorrection]


@lru_cache(maxsize=16)
def walk_parameters(body: LeggedBody, stride: StrideKeys) -> WalkParameters:
    """Return how a body walks with such strides. Raises BadRequest where legs or masses are none."""
    rest = forward_kinematics(body, np.zeros(len(body.joints)))
    left, right = (sole_pose(body, rest, side)[0] for side in SIDES)
    feet = float(left[1] - right[1]) if stride.feet is None else stride.feet
    leg = body.legs["left"]
    if feet < leg.width:
        raise BadRequest(
            f"base: soles {leg.width:g} m wide cannot stand {feet:g} m apart", hint="give stride.feet more"
        )
    ready = standing_angles(body, stride, feet)
    centre = centre_over_legs(body, ready.reshape(2, 6))
    height = stride.height + float((rotation_about(Y, np.array(stride.lean)) @ centre)[2])
    if not height > MIN_COM_HEIGHT:
        hint = "z is up: look at `centre` of trunk and links, and at stride.height"
        raise BadRequest(f"base: the body's centre of mass would be {length_text(height)} above its soles", hint=hint)
    return WalkParameters(
        step_time=stride.period / 2,
        double_support=stride.double_support,
        rise=stride.rise,
        foot_spacing=feet,
        inset=sole_inset(stride, feet, leg.width, height),
        max_step=stride.longest,
        max_side_step=stride.widest,
        max_turn=stride.most_turn,
        com_height=height,
        sole_length=leg.length,
        sole_width=leg.width,
    )


def standing_angles(body: LeggedBody, stride: StrideKeys, feet: float) -> Floats:
    """Return the angles (12,) in which a walk begins and ends. Raises BadRequest where the legs cannot have them."""
    angles, reason = solve_stands(body, stride, feet, np.array([stride.height]))
    if reason.any():
        raise BadRequest(
            f"base: with the trunk {stride.height:g} m above the soles {UNREACHABLE_REASONS[int(reason.max())]}",
            hint="change stride.height, or the lengths of the body",
        )
    found: Floats = angles[0]
    return found


def solve_stands(
    body: LeggedBody, stride: StrideKeys, feet: float, heights: Floats
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return the angles (K, 12) of stands with the trunk at ``heights`` (K,), and why a leg has none (K, 2)."""
    places = np.array([[0.0, feet / 2, 0.0], [0.0, -feet / 2, 0.0]])
    lean, trunk = rotation_about(Y, np.array(stride.lean)), np.zeros((len(heights), 3))
    trunk[:, 2] = heights
    for _ in range(STAND_ITERATIONS):  # over the middle of the soles with all its mass
        angles = solve_legs(body, trunk, lean, places, np.zeros(2))[0]
        centre = centre_over_legs(body, np.nan_to_num(angles).reshape(-1, 2, 6))
        trunk[:, :2] = -(centre @ lean.T)[:, :2]
    return solve_legs(body, trunk, lean, places, np.zeros(2))


def solve_legs(
    body: LeggedBody, trunk: Floats, rotation: Floats, feet: Floats, headings: Floats
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return angles (..., 12) for soles flat at ``feet`` (..., 2, 3) with ``headings`` (..., 2); and reasons (..., 2).

    ``trunk`` (..., 3) and ``turned`` (..., 3, 3) are where the trunk is, in the same frame.
    """
    places = (feet - trunk[..., None, :]) @ rotation
    back = np.swapaxes(rotation, -1, -2)[..., None, :, :]
    found = solve_both_legs(body, places, back @ rotation_about(Z, headings))
    return found.angles.reshape(*found.angles.shape[:-2], 12), found.reason


def whole_body_pose(body: LeggedBody, angles: Floats, rest: Floats | None = None) -> Floats:
    """Return poses (..., N) with both legs at ``angles`` (..., 12) and all else at ``reset`` (N), or at 0."""
    q = np.zeros((*angles.shape[:-1], len(body.joints)))
    if rest is not None:
        q[...] = rest
    q[..., body.leg_indices] = angles
    return q


class WalkingEngine:
    """Walks: ``step`` after ``step`` of time it says where the legs are to be.

    The trunk goes so that the centre of mass would follow the pendulum if both legs stood: what a swinging leg shifts,
    it gives back by its momentum, and servos follow a steady trunk better. ``balance`` is asked with what is felt, if
    it is. Raises BadRequest for strides that the legs cannot make.
    """

    def __init__(self, body: LeggedBody, stride: StrideKeys, balance: BalanceFunction | None = None) -> None:
        self.body, self.stride = body, stride
        self.walker = WalkPatternGenerator(walk_parameters(body, stride))
        self.ready_angles = standing_angles(body, stride, self.walker.manner.foot_spacing)
        self.balance = balance
        self._angles = self.ready_angles
        self._com_offset = self._compute_com_offset(self.ready_angles, (0.0, 0.0))
        self._correction = BalanceCorrection()

    @property
    def is_standing(self) -> bool:
        """True while it stands and nothing is under way."""
        return self.walker.is_standing

    @property
    def pose(self) -> tuple[FloorPose, tuple[float, float, float]]:
        """Where its steps have led it, without its sway, and how fast it goes: ahead, left (m/s), turn (rad/s)."""
        return self.walker.pose

    def command(self, ahead: float, left: float, turn: float) -> tuple[float, float, float]:
        """Walk so (m/s, m/s, rad/s) from the next step on; return what of it the legs can do."""
        return self.walker.command(ahead, left, turn)

    def halt(self) -> None:
        """Come to a stand: with the step that is under way, and one that closes the feet."""
        self.walker.command(0.0, 0.0, 0.0)

    def reset(self) -> None:
        """Forget what was under way: the legs are not where they should be."""
        self.halt()
        self.walker.reset()
        self._angles, self._correction = self.ready_angles, BalanceCorrection()

    def shift(self, displacement: FloorPose) -> None:
        """Stand so far ahead (m), to the left (m) and turned (rad): by steps that were not its own."""
        self.walker.shift(displacement)

    def step(self, dt: float = CONTROL_INTERVAL, attitude: AttitudeEstimate | None = None) -> LegPosture:
        """Go on by ``dt`` seconds; return where the legs are to be."""
        pattern = self.walker.advance(dt)
        added = self._correction
        turned, feet, headings = self._foot_targets(pattern, added)
        c, s = cos(pattern.heading), sin(pattern.heading)
        ahead, left = self._com_offset
        x, y = pattern.centre[0] - c * ahead + s * left, pattern.centre[1] - s * ahead - c * left
        trunk = np.array([x, y, self.stride.height - added.down])
        angles, reason = solve_legs(self.body, trunk, turned, feet, headings)
        refused = ""
        for number, side in enumerate(SIDES):
            if reason[number]:
                half = slice(6 * number, 6 * number + 6)
                angles[half] = self._angles[half]
                refused = f"{side} leg: {UNREACHABLE_REASONS[int(reason[number])]}"
        self._angles = angles
        posture = LegPosture(self._apply_ankle_correction(angles, added), pattern, refused)
        if attitude is not None and self.balance is not None:
            self._correction = self.balance(attitude, posture)
        else:  # nothing measures it any more: what was added fades, for a leap in both ankles would throw it
            self._correction = self._correction.fade(dt)
        self.walker.landing_offset = self._correction.step
        return posture

    def _foot_targets(self, pattern: WalkPattern, correction: BalanceCorrection) -> tuple[Floats, Floats, Floats]:
        turned = _rotation(pattern.heading, correction.hip[0], self.stride.lean + correction.hip[1])
        soles = [pattern.feet[side] for side in SIDES]
        return turned, np.array([each[:3] for each in soles]), np.array([each[3] for each in soles])

    def _compute_com_offset(self, angles: Floats, hip: tuple[float, float]) -> tuple[float, float]:
        """Return how far the centre of mass is ahead and to the left of the trunk's origin."""
        centre = centre_over_legs(self.body, angles.reshape(2, 6))
        ahead, left, _ = (_rotation(0.0, hip[0], self.stride.lean + hip[1]) @ centre).tolist()
        return ahead, left

    def _apply_ankle_correction(self, angles: Floats, correction: BalanceCorrection) -> Floats:
        if correction.ankle == (0.0, 0.0):
            return angles
        angles = angles.copy()
        for number, side in enumerate(SIDES):
            for place, axis, way in ((5, 0, correction.ankle[0]), (4, 1, correction.ankle[1])):
                angles[6 * number + place] += way * self.body.axis[self.body.legs[side].joints[place]][axis]
        return angles


def _rotation(yaw: float, roll: float, pitch: float) -> Floats:
    """Return the orientation of what is turned about z, rolled about its x, then pitched about its y."""
    cz, sz, cx, sx, cy, sy = cos(yaw), sin(yaw), cos(roll), sin(roll), cos(pitch), sin(pitch)
    return np.array(
        [
            [cz * cy - sz * sx * sy, -sz * cx, cz * sy + sz * sx * cy],
            [sz * cy + cz * sx * sy, cz * cx, sz * sy - cz * sx * cy],
            [-cx * sy, sx, cx * cy],
        ]
    )


def plan_walk(body: LeggedBody, stride: StrideKeys, command: tuple[float, float, float], seconds: float) -> WalkPlan:
    """Return a walk of so many seconds from a stand, worked out at once."""
    walker = WalkPatternGenerator(walk_parameters(body, stride))
    walker.command(*command)
    return solve_patterns(
        body, stride, [walker.advance(CONTROL_INTERVAL) for _ in range(round(seconds / CONTROL_INTERVAL))]
    )


def solve_patterns(body: LeggedBody, stride: StrideKeys, patterns: list[WalkPattern]) -> WalkPlan:
    """Return the angles of a stretch of a pattern, as the engine has them."""
    heading = np.array([each.heading for each in patterns])
    feet = np.array([[each.feet[side][:3] for side in SIDES] for each in patterns])
    headings = np.array([[each.feet[side][3] for side in SIDES] for each in patterns])
    centre = np.array([each.centre for each in patterns])
    turned = rotation_about(Z, heading) @ rotation_about(Y, np.array(stride.lean))
    ready = standing_angles(body, stride, walk_parameters(body, stride).foot_spacing)
    off = (turned @ centre_over_legs(body, ready.reshape(2, 6))[:, None])[..., :2, 0]
    trunk = np.column_stack((centre - off, np.full(len(centre), stride.height)))
    angles, reason = solve_legs(body, trunk, turned, feet, headings)
    times = np.array([each.time for each in patterns])
    return WalkPlan(times, tuple(patterns), angles, trunk, heading, reason)
