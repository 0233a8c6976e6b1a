"""Walking engine: computes the leg angles of a walk, 100 times a second; its caller passes the elapsed time."""

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
"""Seconds in which the balance correction fades once the attitude is no longer measured."""

MIN_COM_HEIGHT = 0.05
"""Lowest plausible height of the centre of mass of a standing body above the soles, in metres."""

_, Y, Z = np.eye(3)

STAND_ITERATIONS = 2
"""Number of iterations that move a stand until its centre of mass is over the middle of the soles."""


@dataclass(frozen=True, slots=True)
class AttitudeEstimate:
    """Measured attitude of the trunk: roll and pitch (radians from upright), and their rates (rad/s).

    ``pressure`` is the point of pressure relative to the middle between both feet (m); None if the soles do not measure
    it.
    """

    roll: float
    pitch: float
    roll_rate: float = 0.0
    pitch_rate: float = 0.0
    pressure: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class BalanceCorrection:
    """Correction of the balance controller: trunk roll and pitch, both ankles (radians), and the next landing.

    ``step`` is in metres ahead and to the left, ``down`` in metres by which the trunk is lowered.
    """

    hip: tuple[float, float] = (0.0, 0.0)
    ankle: tuple[float, float] = (0.0, 0.0)
    step: tuple[float, float] = (0.0, 0.0)
    down: float = 0.0

    def fade(self, dt: float) -> "BalanceCorrection":
        """Return the remaining correction after ``dt`` seconds without a measurement."""
        left = max(0.0, 1.0 - dt / FADE_TIME)
        (roll, pitch), (one, other) = self.hip, self.ankle
        return BalanceCorrection((left * roll, left * pitch), (left * one, left * other), (0.0, 0.0), left * self.down)


@dataclass(frozen=True, slots=True)
class LegPosture:
    """Target of the legs: ``angles`` (12,) in the order of ``LeggedBody.leg_joints``, and the ``pattern`` behind it.

    ``pattern`` has the places of the feet. ``refused`` is the reason why a leg cannot reach the place of its foot;
    empty if both legs can. Such a leg keeps its last angles.
    """

    angles: Floats
    pattern: WalkPattern
    refused: str = ""


@dataclass(frozen=True)
class WalkPlan:
    """A part of a walk, M samples: leg ``angles`` (M, 12), ``trunk`` position (M, 3) and ``heading`` (M,).

    ``reason`` (M, 2) is 0 or, if a foot cannot be reached, an index into ``UNREACHABLE_REASONS``.
    """

    times: Floats
    patterns: tuple[WalkPattern, ...]
    angles: Floats
    trunk: Floats
    heading: Floats
    reason: npt.NDArray[np.int64] = field(repr=False)


BalanceFunction = Callable[[AttitudeEstimate, LegPosture], BalanceCorrection]


@lru_cache(maxsize=16)
def walk_parameters(body: LeggedBody, stride: StrideKeys) -> WalkParameters:
    """Return the walk parameters of ``body`` for the keys ``stride``. Raises BadRequest for an impossible stand."""
    rest = forward_kinematics(body, np.zeros(len(body.joints)))
    left, right = (sole_pose(body, rest, side)[0] for side in SIDES)
    feet = float(left[1] - right[1]) if stride.feet is None else stride.feet
    leg = body.legs["left"]
    if feet < leg.width:
        raise BadRequest(f"base: soles {leg.width:g} m wide cannot stand {feet:g} m apart", hint="increase stride.feet")
    ready = standing_angles(body, stride, feet)
    centre = centre_over_legs(body, ready.reshape(2, 6))
    height = stride.height + float((rotation_about(Y, np.array(stride.lean)) @ centre)[2])
    if not height > MIN_COM_HEIGHT:
        hint = "z is up: check `centre` of trunk and links, and stride.height"
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
    """Return the angles (12,) in which a walk begins and ends. Raises BadRequest if they are out of reach."""
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
    """Return angles (K, 12) of stands with the trunk at ``heights`` (K,), and a reason for each leg (K, 2).

    The reason is 0 or, if the leg cannot reach the floor, an index into ``UNREACHABLE_REASONS``. ``feet`` is the
    distance between the feet (m).
    """
    places = np.array([[0.0, feet / 2, 0.0], [0.0, -feet / 2, 0.0]])
    lean, trunk = rotation_about(Y, np.array(stride.lean)), np.zeros((len(heights), 3))
    trunk[:, 2] = heights
    for _ in range(STAND_ITERATIONS):  # its centre of mass over the middle of the soles
        angles = solve_legs(body, trunk, lean, places, np.zeros(2))[0]
        centre = centre_over_legs(body, np.nan_to_num(angles).reshape(-1, 2, 6))
        trunk[:, :2] = -(centre @ lean.T)[:, :2]
    return solve_legs(body, trunk, lean, places, np.zeros(2))


def solve_legs(
    body: LeggedBody, trunk: Floats, rotation: Floats, feet: Floats, headings: Floats
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return angles (..., 12) for level soles at ``feet`` (..., 2, 3) with ``headings`` (..., 2), and reasons (..., 2).

    ``trunk`` (..., 3) and ``rotation`` (..., 3, 3) are the pose of the trunk, in the same frame. A reason is 0 or, for
    a foot that cannot be reached, an index into ``UNREACHABLE_REASONS``.
    """
    places = (feet - trunk[..., None, :]) @ rotation
    back = np.swapaxes(rotation, -1, -2)[..., None, :, :]
    found = solve_both_legs(body, places, back @ rotation_about(Z, headings))
    return found.angles.reshape(*found.angles.shape[:-2], 12), found.reason


def whole_body_pose(body: LeggedBody, angles: Floats, rest: Floats | None = None) -> Floats:
    """Return poses (..., N) with both legs at ``angles`` (..., 12) and all other joints at ``rest`` (N), or at 0."""
    q = np.zeros((*angles.shape[:-1], len(body.joints)))
    if rest is not None:
        q[...] = rest
    q[..., body.leg_indices] = angles
    return q


class WalkingEngine:
    """Walking engine: each ``step`` returns the next leg posture.

    The trunk is moved as if both legs always stood, although a swinging leg shifts the centre of mass: the momentum of
    the leg compensates this shift, and servos follow a steady trunk better. ``balance`` is called with the attitude of
    the trunk, if it is measured, and returns a correction. Raises BadRequest for strides that the legs cannot make.
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
        """True while the body stands at rest."""
        return self.walker.is_standing

    @property
    def pose(self) -> tuple[FloorPose, tuple[float, float, float]]:
        """Pose of the robot on the floor after the steps so far, and its velocity: ahead, left (m/s), turn (rad/s).

        The sway of the trunk from foot to foot is left out.
        """
        return self.walker.pose

    def command(self, ahead: float, left: float, turn: float) -> tuple[float, float, float]:
        """Set the velocity (m/s, m/s, rad/s) from the next step on; return the velocity that the legs can reach."""
        return self.walker.command(ahead, left, turn)

    def halt(self) -> None:
        """Come to a stand: finish the current step and close the feet."""
        self.walker.command(0.0, 0.0, 0.0)

    def reset(self) -> None:
        """Drop the current step: the legs are not where they should be."""
        self.halt()
        self.walker.reset()
        self._angles, self._correction = self.ready_angles, BalanceCorrection()

    def shift(self, displacement: FloorPose) -> None:
        """Move the pose by ``displacement``, caused by a motion other than a walk: ahead, left (m), turn (rad)."""
        self.walker.shift(displacement)

    def step(self, dt: float = CONTROL_INTERVAL, attitude: AttitudeEstimate | None = None) -> LegPosture:
        """Advance by ``dt`` seconds; return the next posture."""
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
        else:  # without measurement the correction fades: a jump in both ankles would throw it over
            self._correction = self._correction.fade(dt)
        self.walker.landing_offset = self._correction.step
        return posture

    def _foot_targets(self, pattern: WalkPattern, correction: BalanceCorrection) -> tuple[Floats, Floats, Floats]:
        turned = _rotation(pattern.heading, correction.hip[0], self.stride.lean + correction.hip[1])
        soles = [pattern.feet[side] for side in SIDES]
        return turned, np.array([each[:3] for each in soles]), np.array([each[3] for each in soles])

    def _compute_com_offset(self, angles: Floats, hip: tuple[float, float]) -> tuple[float, float]:
        """Return the offset of the centre of mass from the trunk's origin, ahead and to the left (m).

        ``hip`` is a correction of the trunk's roll and pitch, in radians.
        """
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
    """Return the rotation: yaw about z, then roll about x, then pitch about y."""
    cz, sz, cx, sx, cy, sy = cos(yaw), sin(yaw), cos(roll), sin(roll), cos(pitch), sin(pitch)
    return np.array(
        [
            [cz * cy - sz * sx * sy, -sz * cx, cz * sy + sz * sx * cy],
            [sz * cy + cz * sx * sy, cz * cx, sz * sy - cz * sx * cy],
            [-cx * sy, sx, cx * cy],
        ]
    )


def plan_walk(body: LeggedBody, stride: StrideKeys, command: tuple[float, float, float], seconds: float) -> WalkPlan:
    """Return a walk with velocity ``command`` (m/s, m/s, rad/s) that begins in a stand and takes ``seconds``."""
    walker = WalkPatternGenerator(walk_parameters(body, stride))
    walker.command(*command)
    return solve_patterns(
        body, stride, [walker.advance(CONTROL_INTERVAL) for _ in range(round(seconds / CONTROL_INTERVAL))]
    )


def solve_patterns(body: LeggedBody, stride: StrideKeys, patterns: list[WalkPattern]) -> WalkPlan:
    """Return the leg angles for a sequence of patterns."""
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
