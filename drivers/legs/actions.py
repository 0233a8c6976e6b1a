"""Leg actions other than walking: stand, sit, and gaits, each starting and ending in a stable pose.

A gait begins in a stand, grows to its full size over one of its cycles, and shrinks back into the stand over another.
So it can be ended at any time, and ending it causes no fall.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import atan2, degrees, radians
from typing import Literal

import numpy as np
import numpy.typing as npt

from drivers.api import COMMAND_TIMEOUT, JointLimits, JointState, Pose2D, Reading
from drivers.api.base import LEG_ACTS
from drivers.api.base import Posture as Poised
from drivers.api.gait import GaitKeys
from drivers.errors import BadRequest, DeviceFault
from drivers.legs.body import SIDES, Floats, LeggedBody
from drivers.legs.declared import StrideKeys
from drivers.legs.engine import LegPosture, WalkingEngine, solve_legs, solve_stands, walk_parameters, whole_body_pose
from drivers.legs.gait import Gait, gait_from_keys
from drivers.legs.gait_check import gait_errors
from drivers.legs.kinematics import FootOdometry, centre_of_mass, forward_kinematics, rotation_about, sole_pose
from drivers.legs.pattern_generator import FloorPose, WalkPattern

# The way of the legs from their pose to a stand or a sit: slow, smooth, and over the soles if possible.

START_TOLERANCE = radians(6)
"""Radians by which each joint may differ from the start pose of a walk, so that the walk can begin at once."""

MAX_START_DISTANCE = radians(62)
"""Maximum difference in radians of any joint from its angle in a stand, for legs that move directly to a stand."""

MAX_POSE_DISTANCE = radians(20)
"""Maximum difference in radians of any joint from its angle in the nearest pose of ``StandSitPoses``.

Legs within this distance move by that pose to a stand or a sit, and the body keeps its balance.
"""

MAX_APPROACH_SPEED = radians(35)
"""Maximum joint speed (rad/s) on the way to a stand or a sit."""

MIN_APPROACH_TIME = 0.5
"""Minimum duration in seconds of a motion to a stand or a sit."""

HEIGHT_STEP = 0.003
"""Difference in metres between the trunk heights of two neighbouring poses of ``StandSitPoses``."""

DEFAULT_SIT_SHARE = 0.7
"""Height of a sit as a share of the stand's, if the robot file has no ``stride.sit``."""


@dataclass(frozen=True, slots=True)
class Approach:
    """Timed path through the leg poses ``poses`` (K, 12); times in seconds.

    ``at_shares`` (K,) are the shares (0..1) of the path's time at which the poses are reached.
    """

    poses: Floats
    at_shares: Floats
    start_time: float
    end_time: float

    @classmethod
    def start(cls, poses: Floats, now: float) -> "Approach":
        """Return the path through ``poses`` (K, 12) from time ``now`` on, at ``MAX_APPROACH_SPEED`` or less."""
        far = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(poses, axis=0)).max(axis=1))))
        shares = far / far[-1] if far[-1] > 0 else np.linspace(0.0, 1.0, len(poses))
        return cls(poses, shares, now, now + max(MIN_APPROACH_TIME, 1.5 * float(far[-1]) / MAX_APPROACH_SPEED))

    def share(self, now: float) -> float:
        """Return the share of the path's duration that has elapsed at ``now``, 0..1."""
        return min(1.0, (now - self.start_time) / (self.end_time - self.start_time))

    def angles_at(self, now: float) -> Floats:
        """Return the joint angles (12,) at time ``now``."""
        share = self.share(now)
        share *= share * (3 - 2 * share)
        return np.array([np.interp(share, self.at_shares, column) for column in self.poses.T])


class StandSitPoses:
    """Poses of the legs between upright and sit, with the centre of mass over the middle of both soles.

    ``stand`` and ``sit`` are indices into ``poses`` (K, 12). Raises BadRequest for a sit that is out of reach.
    """

    def __init__(self, body: LeggedBody, stride: StrideKeys, limits: Mapping[str, JointLimits]) -> None:
        feet = walk_parameters(body, stride).foot_spacing
        lowest = DEFAULT_SIT_SHARE * stride.height if stride.sit is None else stride.sit
        above = stride.height + HEIGHT_STEP * np.arange(60.0, 0.0, -1.0)
        below = np.arange(stride.height - HEIGHT_STEP, lowest, -HEIGHT_STEP)
        rows, reason = solve_stands(body, stride, feet, np.concatenate((above, [stride.height], below, [lowest])))
        reached: npt.NDArray[np.bool_] = np.logical_not(reason.any(axis=1))
        for column, name in enumerate(body.leg_joints):
            reached &= (rows[:, column] >= limits[name].lower) & (rows[:, column] <= limits[name].upper)
        if stride.sit is not None and not reached[-1]:
            told = f"base: its legs cannot bend so far that the trunk is {stride.sit:g} m above the soles"
            raise BadRequest(told, hint="increase stride.sit")
        first = last = len(above)
        while first > 0 and reached[first - 1]:
            first -= 1
        while last + 1 < len(rows) and reached[last + 1]:
            last += 1
        self.poses, self.stand, self.sit = rows[first : last + 1], len(above) - first, last - first

    def path(self, here: Floats, destination: int) -> Floats | None:
        """Return poses (K, 12) from ``here`` to index ``destination``; None if the legs are far from all poses."""
        off = np.abs(self.poses - here).max(axis=1)
        near = int(off.argmin())
        if off[near] > MAX_POSE_DISTANCE:
            if off[self.stand] > MAX_START_DISTANCE:
                return None
            near = self.stand
        between = (
            self.poses[near : destination + 1] if near <= destination else self.poses[destination : near + 1][::-1]
        )
        return np.concatenate((here[None], between))


def start_distances(ready: Floats, names: Iterable[str], states: Mapping[str, Reading[JointState]]) -> dict[str, float]:
    """Return the differences (rad) of joint angles from those at the start of a walk, for all joints with a reading.

    ``ready`` has the angles at the start of a walk, in the order of ``names``.
    """
    goals = zip(names, ready.tolist(), strict=True)
    return {name: value.position - goal for name, goal in goals if (value := states[name].value) is not None}


def is_near_start(ready: Floats, names: Iterable[str], states: Mapping[str, Reading[JointState]]) -> bool:
    """True if all joints are within ``START_TOLERANCE`` of the start of a walk."""
    return all(abs(off) <= START_TOLERANCE for off in start_distances(ready, names, states).values())


STAND, SIT, GAIT = LEG_ACTS

_, Y, _ = np.eye(3)


class GaitCycle:
    """A gait while it is played, from a stand: ``cycles`` counts its cycles.

    ``amplitude`` is 0 in the stand, and 1 once the gait has its full size.
    """

    def __init__(self, body: LeggedBody, lean: float, ready: Floats, gait: Gait) -> None:
        self._body, self._lean, self._gait = body, lean, gait
        placed = forward_kinematics(body, whole_body_pose(body, ready))
        upright = rotation_about(Y, np.array(lean))
        self._stand = np.array([upright @ sole_pose(body, placed, side)[0] for side in SIDES])
        off = np.abs(gait.feet[..., 1].mean(axis=1)) + 10.0 * ~gait.on_floor.all(axis=1)
        self._start_share = float(off.argmin()) / len(off)  # on both feet if possible, and in their middle
        self.cycles = self.amplitude = 0.0
        self.is_ending = False

    @property
    def is_over(self) -> bool:
        """True once the gait has faded out into the stand."""
        return self.is_ending and self.amplitude == 0.0

    def step(self, dt: float) -> tuple[Floats, tuple[bool, bool]]:
        """Advance by ``dt`` seconds; return the leg angles (12,), and which soles are on the floor."""
        share = dt / self._gait.period
        self.cycles += share
        self.amplitude = min(max(self.amplitude + (-share if self.is_ending else share), 0.0), 1.0)
        count = len(self._gait.feet)
        place = (self._start_share + self.cycles) % 1.0 * count
        low, part = int(place) % count, place - int(place)
        feet, headings = (
            (1 - part) * rows[low] + part * rows[(low + 1) % count] for rows in (self._gait.feet, self._gait.headings)
        )
        grown = self.amplitude * self.amplitude * (3 - 2 * self.amplitude)
        turned = rotation_about(Y, np.array((1 - grown) * self._lean))
        soles = self._stand + grown * (feet - self._stand)
        angles, reason = solve_legs(self._body, np.zeros(3), turned, soles, grown * headings)
        if reason.any():  # between two reachable poses; never in a checked gait
            raise DeviceFault(f"{self._gait.name}: a foot is out of reach", hint="mission gait check")
        on = self._gait.on_floor[low]
        return angles, (bool(on[0]), bool(on[1]))


@dataclass(frozen=True, slots=True)
class ActionRequest:
    """Requested leg action, and the time until which it is valid."""

    act: str
    gait: GaitKeys | None
    until: float


class LegActions:
    """Executes leg actions other than walking, as long as they are requested. Angles are in radians.

    ``engine`` is the walking engine of the same legs.
    """

    def __init__(self, engine: WalkingEngine, limits: Mapping[str, JointLimits], torques: Mapping[str, float]) -> None:
        self._engine, self._limits, self._torques = engine, limits, torques
        self._stand_sit_poses: StandSitPoses | None = None
        self._request: ActionRequest | None = None
        self._approach: Approach | None = None
        self._destination = -1
        self._cycle: GaitCycle | None = None
        self._odometry: FootOdometry | None = None
        self._progress = 0.0
        self._error = ""
        self.posture = Poised.UNKNOWN
        self.speed = (0.0, 0.0)

    @property
    def is_busy(self) -> bool:
        """True while an action controls the legs."""
        return self._approach is not None or self._cycle is not None

    def request(self, act: str, gait: GaitKeys | None, now: float) -> float:
        """Request an action such as ``stand`` until ``now`` plus ``COMMAND_TIMEOUT``; return its progress.

        The progress is a share, 1 at the end; for a gait, the number of cycles. Raises BadRequest for an unknown
        action.
        """
        if act not in LEG_ACTS or (act == GAIT) != (gait is not None):
            raise BadRequest(f"base: unknown action '{act}'", hint=f"one of {', '.join(LEG_ACTS)}")
        last = self._request
        if last is None or last.act != act or last.gait != gait or last.until < now:
            self._progress, self._error = 0.0, ""
        self._request = ActionRequest(act, gait, now + COMMAND_TIMEOUT)
        if self._error:
            raise BadRequest(self._error, hint="check the robot, and the gait with `mission gait check`")
        return self._progress

    def cancel(self) -> None:
        """Cancel the request: a gait fades out into a stand; a motion to a stand or a sit stops where it is."""
        self._request = None

    def reset(self) -> None:
        """Stop controlling the legs at once, because they are not in the position that the action expects."""
        self._approach = self._cycle = None
        self.posture, self.speed = Poised.UNKNOWN, (0.0, 0.0)

    def unreachable_reason(self, here: Floats) -> str:
        """Return the reason why legs cannot move from ``here`` (12,) to a stand; empty if they can."""
        levels = self._poses()
        if levels.path(here, levels.stand) is not None:
            return ""
        off = np.abs(here - self._engine.ready_angles)
        name = self._engine.body.leg_joints[int(off.argmax())]
        return f"{name} is {degrees(off.max()):.0f} deg from where a walk begins"

    def step(self, here: Floats, now: float, dt: float, *, walk: bool) -> LegPosture | None:
        """Advance by ``dt`` seconds from the legs' position ``here``; return the next posture.

        Returns None if no action controls the legs. With ``walk`` a walk is requested: the legs come to a stand first,
        and a requested action is ignored.
        """
        asked = self._request if self._request is not None and self._request.until >= now else None
        act = STAND if walk else "" if asked is None else asked.act
        self.speed = (0.0, 0.0)
        if self._cycle is not None:
            return self._play_gait(self._cycle, act, dt)
        if self._approach is not None:
            return self._follow_approach(self._approach, act, now)
        if not act or self._error:
            return None
        try:
            way = self._begin(here, act, asked, now)
        except BadRequest as error:
            self._error = str(error)
            return None
        return None if way is None else self._follow_approach(way, act, now)  # at once, for limp legs are stiff now

    def _poses(self) -> StandSitPoses:
        if self._stand_sit_poses is None:
            self._stand_sit_poses = StandSitPoses(self._engine.body, self._engine.stride, self._limits)
        return self._stand_sit_poses

    def _begin(self, here: Floats, act: str, request: ActionRequest | None, now: float) -> Approach | None:
        """Begin the action ``act``; return the path to a stand or a sit, or None if the action needs no path."""
        levels = self._poses()
        to = levels.sit if act == SIT else levels.stand
        there = self.posture is (Poised.SITTING if act == SIT else Poised.STANDING) or act == GAIT
        if there and np.abs(here - levels.poses[to]).max() <= START_TOLERANCE:
            if act == GAIT and request is not None and request.gait is not None:
                self._cycle = self._prepare_gait(request.gait)
                self._odometry = FootOdometry(self._engine.body, Pose2D(0.0, 0.0, 0.0))
                self.posture = Poised.MOVING
            else:
                self._progress = 1.0
            return None
        way = levels.path(here, to)
        if way is None:
            self._error = f"base: {self.unreachable_reason(here)}"
            return None
        self._approach, self._destination, self.posture = Approach.start(way, now), to, Poised.MOVING
        return self._approach

    def _prepare_gait(self, keys: GaitKeys) -> GaitCycle:
        """Return a gait to be played. Raises BadRequest for an infeasible one."""
        engine = self._engine
        gait = gait_from_keys(keys, engine.body, engine.stride)
        for wrong in gait_errors(engine.body, gait, self._limits, self._torques):
            raise BadRequest(f"{gait.name}: {wrong}", hint="see `mission gait check`")
        return GaitCycle(engine.body, engine.stride.lean, engine.ready_angles, gait)

    def _follow_approach(self, approach: Approach, act: str, now: float) -> LegPosture:
        levels = self._poses()
        wanted = levels.sit if act == SIT else levels.stand
        over = approach.share(now) == 1.0
        if over or not act or wanted != self._destination:
            self._approach = None
            if over:
                self.posture = Poised.SITTING if self._destination == levels.sit else Poised.STANDING
                self._progress = 1.0 if act in (STAND, SIT) and wanted == self._destination else 0.0
            else:
                self.posture = Poised.UNKNOWN
        return make_posture(self._engine.body, approach.angles_at(now), (True, True))

    def _play_gait(self, cycle: GaitCycle, act: str, dt: float) -> LegPosture:
        cycle.is_ending = cycle.is_ending or act != GAIT
        angles, on = cycle.step(dt)
        self._progress = cycle.cycles if act == GAIT and not cycle.is_ending else 0.0
        if cycle.is_over:
            self._cycle, self.posture = None, Poised.STANDING
        posture = make_posture(self._engine.body, angles, on)
        if self._odometry is not None:
            before = self._odometry.pose
            pose = self._odometry.update(whole_body_pose(self._engine.body, angles))
            gone = FloorPose(before.x, before.y, before.heading).relative(FloorPose(pose.x, pose.y, pose.heading))
            self._engine.shift(gone)
            self.speed = (gone.x / dt, gone.heading / dt) if dt > 0 else (0.0, 0.0)
        return posture


def make_posture(body: LeggedBody, angles: Floats, on_floor: tuple[bool, bool]) -> LegPosture:
    """Return the posture of the legs at ``angles`` (12,), with the point of pressure below the centre of mass.

    ``drivers.legs.compensation`` computes joint torques from this point. ``on_floor`` says which soles, left and right,
    are on the floor.
    """
    placed = forward_kinematics(body, whole_body_pose(body, angles))
    feet = {}
    for side in SIDES:
        place, turned = sole_pose(body, placed, side)
        feet[side] = float(place[0]), float(place[1]), 0.0, atan2(turned[1, 0], turned[0, 0])
    x, y, _ = centre_of_mass(body, placed).tolist()
    support: Literal["left", "right", "both"] = (
        "both" if on_floor[0] == on_floor[1] else "left" if on_floor[0] else "right"
    )
    if support != "both":  # within the sole
        foot, leg = feet["left" if on_floor[0] else "right"], body.legs["left"]
        x = min(max(x, foot[0] - leg.length / 2), foot[0] + leg.length / 2)
        y = min(max(y, foot[1] - leg.width / 2), foot[1] + leg.width / 2)
    spot = FloorPose(0.0, 0.0, 0.0)
    pattern = WalkPattern(0.0, support, feet, (x, y), 0.0, (x, y), 0.0, spot, (0.0, 0.0, 0.0))
    return LegPosture(angles, pattern)
