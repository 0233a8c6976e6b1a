"""Where feet and centre of mass go, step after step, for a wanted velocity: the pattern of a walk, without joints.

A step begins with both feet on the floor, while the pressure goes over to the next standing foot; then the other one
swings. Where the next foot lands is settled when a step begins. The capture point is planned backwards over the steps
to come, and led along that plan by the pressure, which stays within the soles.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, cos, cosh, exp, floor, hypot, pi, sin, sinh, sqrt
from typing import Literal

from drivers.errors import BadRequest
from drivers.legs.body import SIDES, Side
from drivers.legs.declared import StrideKeys

# The linear inverted pendulum in closed form: how a body sways over the point that it stands on.
#
# At a constant height z the centre of mass c is pushed away from the point of pressure p: ``c'' = (g / z) (c - p)``.
# Its divergent part, the capture point ``xi = c + c' / w`` with ``w = sqrt(g / z)``, runs from p: ``xi' = w (xi -
# p)``; c follows xi by itself. So a walk is planned backwards: from where xi is to be in the end to where it has to
# be now.

GRAVITY = 9.81

Point = tuple[float, float]


def rate(height: float) -> float:
    """Return w (1/s) of a centre of mass at a height (m)."""
    return sqrt(GRAVITY / height)


def standing(end: Point, p: Point, w: float, seconds: float) -> Point:
    """Return where xi is ``seconds`` before it is at ``end``, with the pressure at ``p`` all the time."""
    decay = exp(-w * seconds)
    return p[0] + (end[0] - p[0]) * decay, p[1] + (end[1] - p[1]) * decay


def shifting(end: Point, p0: Point, p1: Point, w: float, seconds: float, left: float) -> Point:
    """Return where xi is ``left`` seconds before it is at ``end``, while p goes from p0 to p1 in ``seconds``."""
    decay, done = exp(-w * left), 1.0 - left / seconds
    slope = (p1[0] - p0[0]) / seconds / w, (p1[1] - p0[1]) / seconds / w
    x = p0[0] + (p1[0] - p0[0]) * done + slope[0] + (end[0] - p1[0] - slope[0]) * decay
    y = p0[1] + (p1[1] - p0[1]) * done + slope[1] + (end[1] - p1[1] - slope[1]) * decay
    return x, y


def swayed(c: Point, xi: Point, p: Point, w: float, dt: float) -> tuple[Point, Point]:
    """Return c and xi after ``dt`` seconds over a pressure at ``p``: the exact solution."""
    grow, fade = exp(w * dt), exp(-w * dt)
    after = p[0] + (xi[0] - p[0]) * grow, p[1] + (xi[1] - p[1]) * grow
    # c - p = (xi - p) / 2 e^wt + (c - p - (xi - p) / 2) e^-wt
    x, y = ((xi[axis] - p[axis]) / 2 for axis in (0, 1))
    there = (
        p[0] + x * grow + (c[0] - p[0] - x) * fade,
        p[1] + y * grow + (c[1] - p[1] - y) * fade,
    )
    return there, after


def swaying(w: float, step: float, double_support: float) -> float:
    """Return the share of its way that c sways in steps of so many seconds while p goes from side to side.

    p stands still but for the share in double support: where it moves c follows a sinh, where it stands a cosh.
    """
    half = w * step * double_support / 2
    return 1.0 - sinh(half) / (half * cosh(w * step / 2))


Edge = tuple[float, float, float]
"""The line of points with ``nx x + ny y = d``, with its normal outwards."""


def edges(points: Sequence[Point]) -> list[Edge]:
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


def margin(support: Sequence[Edge], p: Point) -> float:
    """Return how far (m) a point is within a support polygon; below 0 outside of it."""
    return min(d - nx * p[0] - ny * p[1] for nx, ny, d in support)


def within(support: Sequence[Edge], inside: Point, p: Point, keep: float) -> Point:
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


# The words of a walk: spots on the floor, a manner of walking, and a moment of its pattern.


@dataclass(frozen=True, slots=True)
class Spot:
    """A place on the floor with a heading, in the frame in which the walk began."""

    x: float
    y: float
    heading: float

    def beside(self, ahead: float, left: float, turn: float = 0.0) -> "Spot":
        """Return the spot so far ahead and to the left of it, turned so far."""
        c, s = cos(self.heading), sin(self.heading)
        return Spot(self.x + ahead * c - left * s, self.y + ahead * s + left * c, self.heading + turn)

    def seen(self, other: "Spot") -> "Spot":
        """Return another spot as it is from this one."""
        c, s = cos(self.heading), sin(self.heading)
        dx, dy = other.x - self.x, other.y - self.y
        return Spot(c * dx + s * dy, c * dy - s * dx, other.heading - self.heading)

    @property
    def point(self) -> Point:
        """Without the heading."""
        return self.x, self.y


@dataclass(frozen=True, slots=True)
class Manner:
    """How it walks: StrideKeys with what follows from the body. Lengths in metres, ``step`` in seconds."""

    step: float
    double_support: float
    rise: float
    feet: float
    inset: float
    longest: float
    widest: float
    most_turn: float
    com_height: float
    length: float
    width: float


@dataclass(frozen=True, slots=True)
class Pattern:
    """A moment of a walk, on the floor of its frame.

    ``feet`` are the middles of the soles (x, y, z, heading); ``centre`` is where the centre of mass is and ``pressure``
    the point of pressure, with its ``margin`` to the edge of the support (m). ``pose`` is where the robot is without
    its sway, going at ``speed`` (ahead m/s, left m/s, turn rad/s).
    """

    time: float
    support: Literal["left", "right", "both"]
    feet: Mapping[Side, tuple[float, float, float, float]]
    centre: Point
    heading: float
    pressure: Point
    margin: float
    pose: Spot
    speed: tuple[float, float, float]


FORESEEN = 3
"""Steps that are planned beyond the present one: those after them count for less than a millimetre."""

SHIFT = 0.7
"""Seconds in which the first step goes over to one foot, and the last one back between both."""

LED = 4.0
"""1/s: how fast the pressure brings the capture point back to its plan."""

KEPT = 0.01
"""Metres that the pressure stays inside of the edges of the soles."""

SETTLED = 0.002
"""Metres from the middle between both feet within which a body that stands has come to rest."""

OTHER: Mapping[Side, Side] = {"left": "right", "right": "left"}
OUT: Mapping[Side, float] = {"left": 1.0, "right": -1.0}


@dataclass(frozen=True, slots=True)
class _Step:
    """A step: first ``both`` seconds on both feet, then ``alone`` seconds in which ``swing`` goes to ``to``.

    One that is ``closing`` puts a foot beside the other, and leads to a stand.
    """

    swing: Side | None
    origin: Spot
    to: Spot
    both: float
    alone: float
    p0: Point
    p1: Point
    end: Point
    before: Spot
    after: Spot
    wide: list[Edge]
    narrow: list[Edge]
    closing: bool = False

    @property
    def duration(self) -> float:
        return self.both + self.alone


def inset_of(stride: StrideKeys, feet: float, width: float, height: float) -> float:
    """Return how far inside of a sole's middle it stands on it, to sway as asked. Raises BadRequest where none does."""
    if stride.sway is None:
        return stride.inset
    share = swaying(rate(height), stride.period / 2, stride.double_support)
    inset, most = feet / 2 - stride.sway / share, width / 2 - KEPT
    if abs(inset) > most:
        low, high = (1000 * share * (feet / 2 + each) for each in (-most, most))
        told = f"base: a sway of {1000 * stride.sway:.0f} mm presses outside of the soles"
        raise BadRequest(told, hint=f"with this stride, give sway {ceil(low)} to {floor(high)} mm")
    return inset


class Walker:
    """The pattern of a walk. It begins at rest, the middle between its feet at (0, 0)."""

    def __init__(self, manner: Manner) -> None:
        self.manner = manner
        self.w = rate(manner.com_height)
        self.time = 0.0
        self.wanted = (0.0, 0.0, 0.0)
        self.nudge: Point = (0.0, 0.0)  # of the next landing, from whoever keeps the balance
        self._place(Spot(0.0, 0.0, 0.0))

    def _place(self, middle: Spot) -> None:
        """Stand with both feet beside each other, at rest."""
        half = self.manner.feet / 2
        self.feet: dict[Side, Spot] = {side: middle.beside(0.0, OUT[side] * half) for side in SIDES}
        self.centre = self.capture = middle.point
        self._middle = middle
        self._step: _Step | None = None
        self._in_step = 0.0
        self._last: Side = "right"

    @property
    def standing(self) -> bool:
        """True while it stands on both feet and nothing is under way."""
        return self._step is None

    def command(self, ahead: float, left: float, turn: float) -> tuple[float, float, float]:
        """Want a velocity (m/s, m/s, rad/s) from the next step on; return what of it steps can make."""
        manner = self.manner
        limits = manner.longest, manner.widest / 2, manner.most_turn / 2  # sideways every other step counts
        x, y, t = (
            min(max(each, -limit / manner.step), limit / manner.step)
            for each, limit in zip((ahead, left, turn), limits, strict=True)
        )
        self.wanted = (x, y, t)
        return self.wanted

    def rest(self) -> None:
        """Stand where it is, from now on, whatever was under way: when nobody knows how the legs are."""
        self._place(self.pose[0])

    def carry(self, gone: Spot) -> None:
        """Stand so far ahead, to the left and turned, as something else has brought it there."""
        self._place(self.pose[0].beside(gone.x, gone.y, gone.heading))

    def advance(self, dt: float) -> Pattern:
        """Go on by ``dt`` seconds."""
        self.time += dt
        if self._step is None and self.wanted != (0.0, 0.0, 0.0):
            self._step, self._in_step = self._first(), 0.0
        pressure, kept = self._sway(dt)
        if self._step is not None:
            self._in_step += dt
            while self._step is not None and self._in_step >= self._step.duration - 1e-9:
                self._in_step -= self._step.duration
                self._step = self._next(self._step)
        pose, speed = self.pose
        return Pattern(self.time, self._on(), self._soles(), self.centre, pose.heading, pressure, kept, pose, speed)

    def _sway(self, dt: float) -> tuple[Point, float]:
        """Sway for ``dt`` seconds over one point of pressure; return that, and its margin (m)."""
        step = self._step
        if step is None:
            pressure, support = self._middle.point, self._support(*(self.feet[side] for side in SIDES))
            plan = pressure
        else:
            support = step.wide if self._in_step < step.both else step.narrow
            plan, pressure = self._plan(step, self._in_step), self._pressed(step, self._in_step + dt / 2)
        gain = 1.0 + LED / self.w
        asked = tuple(pressure[axis] + gain * (self.capture[axis] - plan[axis]) for axis in (0, 1))
        pressure = within(support, pressure, (asked[0], asked[1]), KEPT)
        self.centre, self.capture = swayed(self.centre, self.capture, pressure, self.w, dt)
        return pressure, margin(support, pressure)

    # --- steps --------------------------------------------------------------------------------------------------------

    def _first(self) -> _Step:
        """Return the step that begins a walk: with the foot on whose side it goes."""
        aside = self.wanted[1] or self.wanted[2]
        swing: Side = "left" if aside > 0 or (aside == 0 and self._last == "right") else "right"
        return self._stepping(swing, self._middle, self._middle.point, SHIFT)

    def _next(self, done: _Step) -> _Step | None:
        """Return the step after one that is over; None where it stands then."""
        self._middle = done.after
        if done.swing is None:
            if hypot(*(a - b for a, b in zip(self.capture, self._middle.point, strict=True))) > SETTLED:
                return self._settling(self._middle.point)
            self.centre = self.capture = self._middle.point
            return None
        self.feet[done.swing] = done.to
        self._last = done.swing
        swing = OTHER[done.swing]
        if not done.closing:
            return self._stepping(swing, done.after, done.p1, self.manner.step * self.manner.double_support)
        if self.wanted == (0.0, 0.0, 0.0):
            return self._settling(done.p1)
        return self._stepping(swing, done.after, done.p1, SHIFT)  # it was about to stand

    def _stepping(self, swing: Side, middle: Spot, p0: Point, both: float) -> _Step:
        """Return a step with a foot, from where the pressure is."""
        manner, stand = self.manner, self.feet[OTHER[swing]]
        after = self._moved(middle, swing, self.wanted)
        closing = not (any(self.wanted) or any(self.nudge))
        to = after.beside(*self.nudge).beside(0.0, OUT[swing] * manner.feet / 2)
        if self.nudge != (0.0, 0.0):
            after, self.nudge = to.beside(0.0, -OUT[swing] * manner.feet / 2), (0.0, 0.0)
        p1 = self._anchor(OTHER[swing], stand)
        end = self._ahead(swing, to, after, p1, closing=closing)
        alone = manner.step * (1.0 - manner.double_support)
        origin, narrow = self.feet[swing], self._support(stand)
        wide = self._support(origin, stand)
        return _Step(swing, origin, to, both, alone, p0, p1, end, middle, after, wide, narrow, closing)

    def _settling(self, p0: Point) -> _Step:
        """Return the end of a walk: back between both feet."""
        middle, support = self._middle, self._support(*(self.feet[side] for side in SIDES))
        point = middle.point
        return _Step(None, middle, middle, SHIFT, 0.0, p0, point, point, middle, middle, support, support)

    def _moved(self, middle: Spot, swing: Side, wanted: tuple[float, float, float]) -> Spot:
        """Return the middle after a step: to a side, it goes with the foot of that side."""
        ahead, left, turn = (each * self.manner.step for each in wanted)
        left, turn = (2 * each if each * OUT[swing] > 0 else 0.0 for each in (left, turn))
        return middle.beside(0.0, 0.0, turn / 2).beside(ahead, left, turn / 2)

    def _anchor(self, side: Side, spot: Spot) -> Point:
        return spot.beside(0.0, -OUT[side] * self.manner.inset).point

    def _ahead(self, swing: Side, to: Spot, after: Spot, p1: Point, *, closing: bool) -> Point:
        """Return where the capture point is to be when a step ends: by the steps to come, and then a stand."""
        manner = self.manner
        spots, middle, side = [p1, self._anchor(swing, to)], after, OTHER[swing]
        for _ in range(0 if closing else FORESEEN):
            middle = self._moved(middle, side, self.wanted)
            spots.append(self._anchor(side, middle.beside(0.0, OUT[side] * manner.feet / 2)))
            side = OTHER[side]
        both = manner.step * manner.double_support
        found = middle.point
        if len(spots) == 2:  # the last step: back between both feet
            return shifting(found, p1, found, self.w, SHIFT, SHIFT)
        found = shifting(found, spots[-1], found, self.w, SHIFT, SHIFT)
        for before, after_ in zip(spots[-2::-1], spots[:0:-1], strict=True):
            found = standing(found, after_, self.w, manner.step - both)
            found = shifting(found, before, after_, self.w, both, both)
        return found

    # --- within a step ------------------------------------------------------------------------------------------------

    def _plan(self, step: _Step, at: float) -> Point:
        """Return where the capture point is to be ``at`` seconds into a step."""
        if at >= step.both:
            return standing(step.end, step.p1, self.w, step.duration - at)
        over = standing(step.end, step.p1, self.w, step.alone)
        return shifting(over, step.p0, step.p1, self.w, step.both, step.both - at)

    @staticmethod
    def _pressed(step: _Step, at: float) -> Point:
        """Return where the pressure is to be ``at`` seconds into a step."""
        done = min(at / step.both, 1.0)
        return step.p0[0] + (step.p1[0] - step.p0[0]) * done, step.p0[1] + (step.p1[1] - step.p0[1]) * done

    def _on(self) -> Literal["left", "right", "both"]:
        step = self._step
        return "both" if step is None or step.swing is None or self._in_step < step.both else OTHER[step.swing]

    def _soles(self) -> Mapping[Side, tuple[float, float, float, float]]:
        found = {side: (spot.x, spot.y, 0.0, spot.heading) for side, spot in self.feet.items()}
        step = self._step
        if step is not None and step.swing is not None and self._in_step > step.both:
            share = (self._in_step - step.both) / step.alone
            # What servos can follow: no leap in how a motion gathers speed, but at its ends.
            way, up = (1.0 - cos(pi * share)) / 2, sin(pi * share) ** 2
            a, b = step.origin, step.to
            found[step.swing] = (
                a.x + way * (b.x - a.x),
                a.y + way * (b.y - a.y),
                self.manner.rise * up,
                a.heading + way * (b.heading - a.heading),
            )
        return found

    @property
    def pose(self) -> tuple[Spot, tuple[float, float, float]]:
        """Return where the robot is by its steps, without its sway, and how fast it goes."""
        step = self._step
        if step is None or step.swing is None:
            return self._middle, (0.0, 0.0, 0.0)
        a, b, share = step.before, step.after, self._in_step / step.duration
        x, y, turn = b.x - a.x, b.y - a.y, b.heading - a.heading
        pose = Spot(a.x + share * x, a.y + share * y, a.heading + share * turn)
        c, s, long = cos(pose.heading), sin(pose.heading), step.duration
        return pose, ((x * c + y * s) / long, (y * c - x * s) / long, turn / long)

    def _support(self, *spots: Spot) -> list[Edge]:
        """Return the polygon that soles at some spots make."""
        long, wide = self.manner.length / 2, self.manner.width / 2
        return edges([spot.beside(u * long, v * wide).point for spot in spots for u in (-1, 1) for v in (-1, 1)])
