"""Walking pattern generator (gait generator): path of feet and centre of mass for a velocity command, without joints.

A step begins in double support, while the pressure moves to the next supporting foot; then comes the swing phase of the
other foot. The landing of a foot is fixed when its step begins. The capture point is planned backwards over the next
steps, and steered along that plan by the pressure, which stays within the soles.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, cos, cosh, exp, floor, hypot, pi, sin, sinh, sqrt
from typing import Literal

from drivers.errors import BadRequest
from drivers.legs.body import SIDES, Side
from drivers.legs.declared import StrideKeys

# The linear inverted pendulum in closed form: the sway of a body over its point of support.
#
# At a constant height z the centre of mass c is pushed away from the point of pressure p: ``c'' = (g / z) (c - p)``.
# Its divergent part, the capture point ``xi = c + c' / w`` with ``w = sqrt(g / z)``, runs from p: ``xi' = w (xi -
# p)``; c follows xi by itself. So a walk is planned backwards, from the final xi to the present one.

GRAVITY = 9.81

Point = tuple[float, float]


def pendulum_rate(height: float) -> float:
    """Return the rate in 1/s at which a body falls over like an inverted pendulum: the root of g / ``height``.

    ``height`` is that of its centre of mass in metres.
    """
    return sqrt(GRAVITY / height)


def capture_before_stand(end: Point, p: Point, w: float, seconds: float) -> Point:
    """Return the capture point ``seconds`` before it reaches ``end``, with constant pressure at ``p``.

    ``w`` is the pendulum rate (1/s).
    """
    decay = exp(-w * seconds)
    return p[0] + (end[0] - p[0]) * decay, p[1] + (end[1] - p[1]) * decay


def capture_before_shift(end: Point, p0: Point, p1: Point, w: float, seconds: float, left: float) -> Point:
    """Return the capture point ``left`` seconds before it reaches ``end``, while the pressure moves.

    The pressure moves from ``p0`` to ``p1``, which takes ``seconds``; ``w`` is the pendulum rate (1/s).
    """
    decay, done = exp(-w * left), 1.0 - left / seconds
    slope = (p1[0] - p0[0]) / seconds / w, (p1[1] - p0[1]) / seconds / w
    x = p0[0] + (p1[0] - p0[0]) * done + slope[0] + (end[0] - p1[0] - slope[0]) * decay
    y = p0[1] + (p1[1] - p0[1]) * done + slope[1] + (end[1] - p1[1] - slope[1]) * decay
    return x, y


def advance_pendulum(c: Point, xi: Point, p: Point, w: float, dt: float) -> tuple[Point, Point]:
    """Return centre of mass c and capture point xi after ``dt`` seconds over a pressure ``p``: the exact solution."""
    grow, fade = exp(w * dt), exp(-w * dt)
    after = p[0] + (xi[0] - p[0]) * grow, p[1] + (xi[1] - p[1]) * grow
    # c - p = (xi - p) / 2 e^wt + (c - p - (xi - p) / 2) e^-wt
    x, y = ((xi[axis] - p[axis]) / 2 for axis in (0, 1))
    there = (
        p[0] + x * grow + (c[0] - p[0] - x) * fade,
        p[1] + y * grow + (c[1] - p[1] - y) * fade,
    )
    return there, after


def sway_share(w: float, step: float, double_support: float) -> float:
    """Return the sway of the centre of mass as a share of the sway of the pressure, for steps from side to side.

    A step takes ``step`` seconds, of which ``double_support`` is the share on both feet; ``w`` is the pendulum rate
    (1/s). The pressure moves only in double support, in which the centre of mass follows a sinh; else it follows a
    cosh.
    """
    half = w * step * double_support / 2
    return 1.0 - sinh(half) / (half * cosh(w * step / 2))


Edge = tuple[float, float, float]
"""Line of points with ``nx x + ny y = d``, with its normal outwards."""


def hull_edges(points: Sequence[Point]) -> list[Edge]:
    """Return the edges of the convex hull of some points (Andrew's monotone chain)."""
    ordered = sorted(set(points))

    def chain(these: Sequence[Point]) -> list[Point]:
        found: list[Point] = []
        for x, y in these:
            while len(found) > 1 and _turn(found[-2], found[-1], (x, y)) <= 0:
                found.pop()
            found.append((x, y))
        return found[:-1]

    hull = chain(ordered) + chain(ordered[::-1])
    lines = []
    for (ax, ay), (bx, by) in zip(hull, hull[1:] + hull[:1], strict=True):
        long = hypot(bx - ax, by - ay)
        nx, ny = (by - ay) / long, (ax - bx) / long
        lines.append((nx, ny, nx * ax + ny * ay))
    return lines


def polygon_margin(support: Sequence[Edge], p: Point) -> float:
    """Return the distance (m) of a point inside a support polygon; negative outside."""
    return min(d - nx * p[0] - ny * p[1] for nx, ny, d in support)


def clamp_to_polygon(support: Sequence[Edge], inside: Point, p: Point, keep: float) -> Point:
    """Return ``p``, or the farthest point towards it from ``inside`` that is ``keep`` metres inside of the polygon."""
    share = 1.0
    for nx, ny, d in support:
        here = d - keep - nx * inside[0] - ny * inside[1]
        way = nx * (p[0] - inside[0]) + ny * (p[1] - inside[1])
        if way > here:
            share = min(share, max(0.0, here) / way)
    return inside[0] + share * (p[0] - inside[0]), inside[1] + share * (p[1] - inside[1])


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


# Types of a walk: footholds, parameters, and a moment of its pattern.


@dataclass(frozen=True, slots=True)
class FloorPose:
    """Position on the floor with a heading, in the frame in which the walk began."""

    x: float
    y: float
    heading: float

    def offset(self, ahead: float, left: float, turn: float = 0.0) -> "FloorPose":
        """Return the pose ahead of and to the left of this one by these distances, turned by ``turn``."""
        c, s = cos(self.heading), sin(self.heading)
        return FloorPose(self.x + ahead * c - left * s, self.y + ahead * s + left * c, self.heading + turn)

    def relative(self, other: "FloorPose") -> "FloorPose":
        """Return another pose relative to this one."""
        c, s = cos(self.heading), sin(self.heading)
        dx, dy = other.x - self.x, other.y - self.y
        return FloorPose(c * dx + s * dy, c * dy - s * dx, other.heading - self.heading)

    @property
    def point(self) -> Point:
        """The position without the heading."""
        return self.x, self.y


@dataclass(frozen=True, slots=True)
class WalkParameters:
    """Parameters of a walk: StrideKeys with values derived from the body. Metres; ``step_time`` in seconds.

    ``rise`` is the step height.
    """

    step_time: float
    double_support: float
    rise: float
    foot_spacing: float
    inset: float
    max_step: float
    max_side_step: float
    max_turn: float
    com_height: float
    sole_length: float
    sole_width: float


@dataclass(frozen=True, slots=True)
class WalkPattern:
    """A sample of a walk, on the floor of its frame.

    ``feet`` are the middles of the soles (x, y, z, heading); ``centre`` is the centre of mass; ``pressure`` is the
    point of pressure, and ``margin`` its distance to the edge of the support (m). ``pose`` is the pose of the robot
    without sway, moving at ``speed`` (ahead m/s, left m/s, turn rad/s).
    """

    time: float
    support: Literal["left", "right", "both"]
    feet: Mapping[Side, tuple[float, float, float, float]]
    centre: Point
    heading: float
    pressure: Point
    margin: float
    pose: FloorPose
    speed: tuple[float, float, float]


PREVIEW_STEPS = 3
"""Steps that are planned after the current one; later steps change less than a millimetre."""

WEIGHT_SHIFT_TIME = 0.7
"""Seconds in which the first step shifts the weight to one foot, and the last one back between both."""

CAPTURE_GAIN = 4.0
"""Gain (1/s) with which the pressure returns the capture point to its plan."""

EDGE_MARGIN = 0.01
"""Metres that the pressure stays inside of the edges of the soles."""

SETTLE_TOLERANCE = 0.002
"""Metres from the middle between both feet within which a standing body is at rest."""

OTHER_SIDE: Mapping[Side, Side] = {"left": "right", "right": "left"}
OUTWARD_SIGN: Mapping[Side, float] = {"left": 1.0, "right": -1.0}


@dataclass(frozen=True, slots=True)
class _Step:
    """A step: ``double_support_time`` seconds on both feet, then ``single_support_time`` seconds of swing.

    ``swing`` is the side of the foot that moves from ``origin`` to ``target``; None if only the weight shifts. A step
    that ``is_closing`` puts a foot beside the other before a stand.
    """

    swing: Side | None
    origin: FloorPose
    target: FloorPose
    double_support_time: float
    single_support_time: float
    p0: Point
    p1: Point
    capture_end: Point
    start_pose: FloorPose
    end_pose: FloorPose
    double_support: list[Edge]
    single_support: list[Edge]
    is_closing: bool = False

    @property
    def duration(self) -> float:
        return self.double_support_time + self.single_support_time


def sole_inset(stride: StrideKeys, feet: float, width: float, height: float) -> float:
    """Return how far inwards from a sole's middle the pressure must be for the configured sway, in metres.

    ``feet`` is the distance between the feet, ``width`` that of a sole, ``height`` that of the centre of mass (m).
    Raises BadRequest for a sway that presses outside of the soles.
    """
    if stride.sway is None:
        return stride.inset
    share = sway_share(pendulum_rate(height), stride.period / 2, stride.double_support)
    inset, most = feet / 2 - stride.sway / share, width / 2 - EDGE_MARGIN
    if abs(inset) > most:
        low, high = (1000 * share * (feet / 2 + each) for each in (-most, most))
        told = f"base: a sway of {1000 * stride.sway:.0f} mm presses outside of the soles"
        raise BadRequest(told, hint=f"with this stride, give sway {ceil(low)} to {floor(high)} mm")
    return inset


class WalkPatternGenerator:
    """Walking pattern generator. It begins at rest, the middle between its feet at (0, 0)."""

    def __init__(self, manner: WalkParameters) -> None:
        self.manner = manner
        self.w = pendulum_rate(manner.com_height)
        self.time = 0.0
        self.velocity_command = (0.0, 0.0, 0.0)
        self.landing_offset: Point = (0.0, 0.0)  # of the next landing, from the balance controller
        self._stand_at(FloorPose(0.0, 0.0, 0.0))

    def _stand_at(self, middle: FloorPose) -> None:
        """Stand with both feet beside each other, at rest."""
        half = self.manner.foot_spacing / 2
        self.feet: dict[Side, FloorPose] = {side: middle.offset(0.0, OUTWARD_SIGN[side] * half) for side in SIDES}
        self.centre = self.capture = middle.point
        self._middle = middle
        self._step: _Step | None = None
        self._time_in_step = 0.0
        self._last_swing: Side = "right"

    @property
    def is_standing(self) -> bool:
        """True while the robot stands on both feet at rest."""
        return self._step is None

    def command(self, ahead: float, left: float, turn: float) -> tuple[float, float, float]:
        """Set the velocity (m/s, m/s, rad/s) from the next step on; return the velocity that steps can reach."""
        manner = self.manner
        limits = manner.max_step, manner.max_side_step / 2, manner.max_turn / 2  # sideways only every other step counts
        x, y, t = (
            min(max(each, -limit / manner.step_time), limit / manner.step_time)
            for each, limit in zip((ahead, left, turn), limits, strict=True)
        )
        self.velocity_command = (x, y, t)
        return self.velocity_command

    def reset(self) -> None:
        """Stand at the current pose at once, for legs in an unknown position."""
        self._stand_at(self.pose[0])

    def shift(self, displacement: FloorPose) -> None:
        """Stand displaced by ``displacement``, after another motion."""
        self._stand_at(self.pose[0].offset(displacement.x, displacement.y, displacement.heading))

    def advance(self, dt: float) -> WalkPattern:
        """Advance by ``dt`` seconds; return the new sample."""
        self.time += dt
        if self._step is None and self.velocity_command != (0.0, 0.0, 0.0):
            self._step, self._time_in_step = self._first_step(), 0.0
        pressure, kept = self._advance_pendulum(dt)
        if self._step is not None:
            self._time_in_step += dt
            while self._step is not None and self._time_in_step >= self._step.duration - 1e-9:
                self._time_in_step -= self._step.duration
                self._step = self._next_step(self._step)
        pose, speed = self.pose
        return WalkPattern(
            self.time, self._support_side(), self._sole_poses(), self.centre, pose.heading, pressure, kept, pose, speed
        )

    def _advance_pendulum(self, dt: float) -> tuple[Point, float]:
        """Advance the pendulum by ``dt`` seconds over one point of pressure; return this point, and its margin (m)."""
        step = self._step
        if step is None:
            pressure, support = self._middle.point, self._support_polygon(*(self.feet[side] for side in SIDES))
            plan = pressure
        else:
            support = step.double_support if self._time_in_step < step.double_support_time else step.single_support
            plan, pressure = (
                self._planned_capture(step, self._time_in_step),
                self._planned_pressure(step, self._time_in_step + dt / 2),
            )
        gain = 1.0 + CAPTURE_GAIN / self.w
        asked = tuple(pressure[axis] + gain * (self.capture[axis] - plan[axis]) for axis in (0, 1))
        pressure = clamp_to_polygon(support, pressure, (asked[0], asked[1]), EDGE_MARGIN)
        self.centre, self.capture = advance_pendulum(self.centre, self.capture, pressure, self.w, dt)
        return pressure, polygon_margin(support, pressure)

    # --- steps --------------------------------------------------------------------------------------------------------

    def _first_step(self) -> _Step:
        """Return the first step of a walk, which swings the foot on the side to which the walk moves or turns."""
        aside = self.velocity_command[1] or self.velocity_command[2]
        swing: Side = "left" if aside > 0 or (aside == 0 and self._last_swing == "right") else "right"
        return self._make_step(swing, self._middle, self._middle.point, WEIGHT_SHIFT_TIME)

    def _next_step(self, done: _Step) -> _Step | None:
        """Return the step that follows ``done``; None if the robot stands after it."""
        self._middle = done.end_pose
        if done.swing is None:
            if hypot(*(a - b for a, b in zip(self.capture, self._middle.point, strict=True))) > SETTLE_TOLERANCE:
                return self._make_final_shift(self._middle.point)
            self.centre = self.capture = self._middle.point
            return None
        self.feet[done.swing] = done.target
        self._last_swing = done.swing
        swing = OTHER_SIDE[done.swing]
        if not done.is_closing:
            return self._make_step(swing, done.end_pose, done.p1, self.manner.step_time * self.manner.double_support)
        if self.velocity_command == (0.0, 0.0, 0.0):
            return self._make_final_shift(done.p1)
        return self._make_step(swing, done.end_pose, done.p1, WEIGHT_SHIFT_TIME)  # it was about to stand

    def _make_step(self, swing: Side, middle: FloorPose, p0: Point, both: float) -> _Step:
        """Return a step of foot ``swing``, which begins with the pressure at ``p0`` and ``both`` seconds on both feet.

        ``middle`` is the pose between the feet when the step begins.
        """
        manner, stand = self.manner, self.feet[OTHER_SIDE[swing]]
        after = self._pose_after_step(middle, swing, self.velocity_command)
        closing = not (any(self.velocity_command) or any(self.landing_offset))
        to = after.offset(*self.landing_offset).offset(0.0, OUTWARD_SIGN[swing] * manner.foot_spacing / 2)
        if self.landing_offset != (0.0, 0.0):
            after, self.landing_offset = to.offset(0.0, -OUTWARD_SIGN[swing] * manner.foot_spacing / 2), (0.0, 0.0)
        p1 = self._pressure_point(OTHER_SIDE[swing], stand)
        end = self._capture_target(swing, to, after, p1, closing=closing)
        alone = manner.step_time * (1.0 - manner.double_support)
        origin, narrow = self.feet[swing], self._support_polygon(stand)
        wide = self._support_polygon(origin, stand)
        return _Step(swing, origin, to, both, alone, p0, p1, end, middle, after, wide, narrow, closing)

    def _make_final_shift(self, p0: Point) -> _Step:
        """Return the end of a walk: the weight shifts back between both feet."""
        middle, support = self._middle, self._support_polygon(*(self.feet[side] for side in SIDES))
        point = middle.point
        return _Step(None, middle, middle, WEIGHT_SHIFT_TIME, 0.0, p0, point, point, middle, middle, support, support)

    def _pose_after_step(self, middle: FloorPose, swing: Side, wanted: tuple[float, float, float]) -> FloorPose:
        """Return the pose between the feet after a step of ``swing`` with velocity ``wanted`` from the pose ``middle``.

        Only the foot on the side of the motion moves the pose sideways, or turns it.
        """
        ahead, left, turn = (each * self.manner.step_time for each in wanted)
        left, turn = (2 * each if each * OUTWARD_SIGN[swing] > 0 else 0.0 for each in (left, turn))
        return middle.offset(0.0, 0.0, turn / 2).offset(ahead, left, turn / 2)

    def _pressure_point(self, side: Side, spot: FloorPose) -> Point:
        return spot.offset(0.0, -OUTWARD_SIGN[side] * self.manner.inset).point

    def _capture_target(self, swing: Side, to: FloorPose, after: FloorPose, p1: Point, *, closing: bool) -> Point:
        """Return the capture point at which a step must end, planned backwards from the next steps and a stand.

        Foot ``swing`` lands at ``to``; ``after`` is then the pose between the feet, and ``p1`` the pressure on the
        other foot. With ``closing`` the robot stands after this step.
        """
        manner = self.manner
        spots, middle, side = [p1, self._pressure_point(swing, to)], after, OTHER_SIDE[swing]
        for _ in range(0 if closing else PREVIEW_STEPS):
            middle = self._pose_after_step(middle, side, self.velocity_command)
            spots.append(self._pressure_point(side, middle.offset(0.0, OUTWARD_SIGN[side] * manner.foot_spacing / 2)))
            side = OTHER_SIDE[side]
        both = manner.step_time * manner.double_support
        found = middle.point
        if len(spots) == 2:  # the last step: back between both feet
            return capture_before_shift(found, p1, found, self.w, WEIGHT_SHIFT_TIME, WEIGHT_SHIFT_TIME)
        found = capture_before_shift(found, spots[-1], found, self.w, WEIGHT_SHIFT_TIME, WEIGHT_SHIFT_TIME)
        for before, after_ in zip(spots[-2::-1], spots[:0:-1], strict=True):
            found = capture_before_stand(found, after_, self.w, manner.step_time - both)
            found = capture_before_shift(found, before, after_, self.w, both, both)
        return found

    # --- within a step ------------------------------------------------------------------------------------------------

    def _planned_capture(self, step: _Step, at: float) -> Point:
        """Return the planned capture point ``at`` seconds into a step."""
        if at >= step.double_support_time:
            return capture_before_stand(step.capture_end, step.p1, self.w, step.duration - at)
        over = capture_before_stand(step.capture_end, step.p1, self.w, step.single_support_time)
        return capture_before_shift(
            over, step.p0, step.p1, self.w, step.double_support_time, step.double_support_time - at
        )

    @staticmethod
    def _planned_pressure(step: _Step, at: float) -> Point:
        """Return the planned pressure ``at`` seconds into a step."""
        done = min(at / step.double_support_time, 1.0)
        return step.p0[0] + (step.p1[0] - step.p0[0]) * done, step.p0[1] + (step.p1[1] - step.p0[1]) * done

    def _support_side(self) -> Literal["left", "right", "both"]:
        step = self._step
        return (
            "both"
            if step is None or step.swing is None or self._time_in_step < step.double_support_time
            else OTHER_SIDE[step.swing]
        )

    def _sole_poses(self) -> Mapping[Side, tuple[float, float, float, float]]:
        found = {side: (spot.x, spot.y, 0.0, spot.heading) for side, spot in self.feet.items()}
        step = self._step
        if step is not None and step.swing is not None and self._time_in_step > step.double_support_time:
            share = (self._time_in_step - step.double_support_time) / step.single_support_time
            # Servos can follow motions whose acceleration jumps only at the ends.
            way, up = (1.0 - cos(pi * share)) / 2, sin(pi * share) ** 2
            a, b = step.origin, step.target
            found[step.swing] = (
                a.x + way * (b.x - a.x),
                a.y + way * (b.y - a.y),
                self.manner.rise * up,
                a.heading + way * (b.heading - a.heading),
            )
        return found

    @property
    def pose(self) -> tuple[FloorPose, tuple[float, float, float]]:
        """Pose of the robot on the floor after the steps so far, and its velocity: ahead, left (m/s), turn (rad/s).

        The sway from foot to foot is left out.
        """
        step = self._step
        if step is None or step.swing is None:
            return self._middle, (0.0, 0.0, 0.0)
        a, b, share = step.start_pose, step.end_pose, self._time_in_step / step.duration
        x, y, turn = b.x - a.x, b.y - a.y, b.heading - a.heading
        pose = FloorPose(a.x + share * x, a.y + share * y, a.heading + share * turn)
        c, s, long = cos(pose.heading), sin(pose.heading), step.duration
        return pose, ((x * c + y * s) / long, (y * c - x * s) / long, turn / long)

    def _support_polygon(self, *spots: FloorPose) -> list[Edge]:
        """Return the edges of the convex hull of soles with the poses ``spots``."""
        long, wide = self.manner.sole_length / 2, self.manner.sole_width / 2
        return hull_edges([spot.offset(u * long, v * wide).point for spot in spots for u in (-1, 1) for v in (-1, 1)])
