"""Leaf that drives around without bumping into obstacles."""

import math
from collections import deque

from py_trees.common import Status

from behaviours.clearance import CLEARANCE_MARGIN, ObstacleView, Points, free_distance, rotate_points, safe_speed
from behaviours.driving.motion import REACTION_TIME, BaseMotion
from behaviours.leaf import FAILURE, argument
from drivers.api import BASE_RADIUS, ZERO_VELOCITY, BaseState, Pose2D, Sides, Steering, Velocity

# Where a base has been, and what of the floor it has not seen yet.

CELL_SIZE = 0.25
"""Edge length in metres of a cell in the grid of visited floor (``VisitedCells``)."""


class VisitedCells:
    """Grid of the floor cells that the base's middle has visited, in the odometry frame."""

    def __init__(self) -> None:
        self._cells: set[tuple[int, int]] = set()

    def __len__(self) -> int:
        return len(self._cells)

    def visit(self, pose: Pose2D) -> None:
        """Add the cell of a pose."""
        self._cells.add(_cell(pose.x, pose.y))

    def unvisited_share(self, pose: Pose2D, heading: float, length: float) -> float:
        """Return the share 0..1 of the next ``length`` metres along ``heading`` that is in cells not visited yet."""
        steps = int(length / CELL_SIZE)
        c, s = CELL_SIZE * math.cos(heading), CELL_SIZE * math.sin(heading)
        new = sum(_cell(pose.x + k * c, pose.y + k * s) not in self._cells for k in range(1, steps + 1))
        return new / steps if steps else 0.0


def _cell(x: float, y: float) -> tuple[int, int]:
    return math.floor(x / CELL_SIZE), math.floor(y / CELL_SIZE)


BLIND_SPEED = 0.1
"""Maximum speed in m/s without a range finder: slow enough to bump into obstacles."""

BACK_OFF_DISTANCE, BACK_OFF_SPEED, BACK_OFF_TIMEOUT = 0.15, 0.1, 4.0
"""Distance (m), speed (m/s) and timeout (s) of backing off after a bump or at an edge."""

HEADINGS = [math.radians(degrees) for degrees in range(-180, 180, 10)]
"""Candidate headings in radians from straight ahead."""

MAX_USEFUL_DISTANCE = 3.0
"""Free distance in metres from which on more distance does not improve the score of a heading."""

SWITCH_FACTOR = 1.25
"""Factor by which another heading must be better than the present one."""

CHOICE_INTERVAL = 0.4
"""Seconds between two choices of the heading."""

MAX_DRIVING_ANGLE = math.radians(30)
"""Heading error in radians beyond which the base only turns."""

TURN_GAIN, MAX_TURN_RATE = 2.0, math.radians(80)
"""Gain of the heading controller in 1/s, and its maximum turn rate in rad/s."""

SHUT_IN_TIMEOUT = 5.0
"""Seconds without a free heading before a failure."""

MAX_REMEMBERED_HITS = 60
"""Number of remembered positions of bumps and edges."""

_BUMPERS = {"left": math.radians(55), "centre": 0.0, "right": math.radians(-55)}


class Wander(BaseMotion):
    """Drive around without bumping into obstacles, and prefer floor that was not visited yet.

    With a range finder it avoids obstacles that are as high as the finder. Without one it drives at no more than 0.1
    m/s and finds obstacles with its bumpers. At a bump or an edge it backs off and remembers the position. Running all
    the time; it never succeeds. Fails if there is no free heading, when a wheel drops, and while the base is latched.
    It waits while a person steers the base.
    """

    tag = "wander"
    example = "- wander: {speed: 0.2 m/s}\n  timeout: 2 min"
    optional_parts = frozenset({"range"})
    ends = frozenset({"failure"})
    speed: float = argument("speed", "maximum speed", default=0.3, low=0.05, high=0.7)
    _lookout: ObstacleView
    _visited: VisitedCells
    _course: float | None = None  # the heading to keep, by odometry
    _chosen_at = -math.inf
    _last_hit: tuple[Pose2D, float] | None = None  # from where it drives back, and since when
    _shut_in_since: float | None = None

    def initialise(self) -> None:
        super().initialise()
        self._lookout, self._visited = ObstacleView(self.robot), VisitedCells()
        self._hits: deque[tuple[float, float]] = deque(maxlen=MAX_REMEMBERED_HITS)
        self._course = self._last_hit = self._shut_in_since = None

    def stop_reason(self, state: BaseState, steering: Steering) -> str:
        if state.wheel_drop:
            return super().stop_reason(state, steering)
        if state.cliff or state.bumper:
            self._remember_hit(state.pose, state.cliff or state.bumper)
        return ""

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        self._visited.visit(state.pose)
        points = self._lookout.points_around(state, self.run.now())
        if points is None and self.robot.ranger_part is not None:
            return self.steer(ZERO_VELOCITY, "waiting for the range finder")
        things = self._obstacles(state.pose, points)
        if self._last_hit is not None and self._must_back_off(state.pose, *self._last_hit, things):
            return self.steer(Velocity(-BACK_OFF_SPEED, 0.0), "backing off")
        self._last_hit = None
        if self._course is None or self.run.now() - self._chosen_at >= CHOICE_INTERVAL:
            self._course, self._chosen_at = self._choose(state.pose, things), self.run.now()
        course = self._course
        if course is None:
            return self._wait_shut_in()
        off = math.remainder(course - state.pose.heading, math.tau)
        turn = max(-MAX_TURN_RATE, min(MAX_TURN_RATE, TURN_GAIN * off))
        status = self.steer(
            Velocity(self._speed(off, free_distance(things), blind=points is None), turn), self._activity(off)
        )
        if status is FAILURE:  # an edge that is not far enough behind it
            self._last_hit = state.pose, self.run.now()
            return self._wait_shut_in()
        if self._refused_since is None:
            self._shut_in_since = None
        return status

    # --- where to ---------------------------------------------------------------------------------------------------

    def _choose(self, pose: Pose2D, things: Points) -> float | None:
        """Return the heading to keep (radians, odometry frame); None if all headings are blocked by ``things``.

        A new heading is chosen only if the present one is blocked or another one is much better.
        """
        ways = [free_distance(things, heading) for heading in HEADINGS]
        if max(ways) <= CLEARANCE_MARGIN:
            return None
        value = [self._score(pose, heading, way) for heading, way in zip(HEADINGS, ways, strict=True)]
        best = value.index(max(value))
        if self._course is not None:
            present = math.remainder(self._course - pose.heading, math.tau)
            way = free_distance(things, present)
            if way > CLEARANCE_MARGIN and self._score(pose, present, way) * SWITCH_FACTOR >= value[best]:
                return self._course
        return pose.heading + HEADINGS[best]

    def _score(self, pose: Pose2D, heading: float, way: float) -> float:
        """Return the score of a heading, from its free distance ``way`` (m), its share of new floor, and its turn."""
        length = min(way, MAX_USEFUL_DISTANCE)
        new = self._visited.unvisited_share(pose, pose.heading + heading, length)
        return length * (0.2 + new) * (1.0 - 0.4 * abs(heading) / math.pi)

    def _speed(self, off: float, way: float, *, blind: bool) -> float:
        """Return the speed (m/s) for a free distance ``way`` (m) and a heading error ``off`` (rad).

        ``blind`` is True without a range finder.
        """
        safe = safe_speed(way, braking=self.braking, reaction=REACTION_TIME)
        return min(self.speed, safe, BLIND_SPEED if blind else math.inf) * max(0.0, 1.0 - abs(off) / MAX_DRIVING_ANGLE)

    # --- what is there ----------------------------------------------------------------------------------------------

    def _obstacles(self, pose: Pose2D, points: Points | None) -> Points:
        """Return the obstacles in view (``points``) and the remembered ones, relative to the base."""
        known = rotate_points([(x - pose.x, y - pose.y) for x, y in self._hits], pose.heading)
        return known if points is None else points + known

    def _remember_hit(self, pose: Pose2D, where: Sides) -> None:
        """Remember an obstacle or edge at the sides ``where`` of the base's rim, and begin to back off."""
        sides = [angle for name, angle in _BUMPERS.items() if getattr(where, name)]
        if self._last_hit is None:
            for angle in sides:
                place = pose.heading + angle
                self._hits.append((pose.x + BASE_RADIUS * math.cos(place), pose.y + BASE_RADIUS * math.sin(place)))
        self._last_hit, self._course = (self._last_hit or (pose, self.run.now())), None

    def _must_back_off(self, pose: Pose2D, origin: Pose2D, since: float, things: Points) -> bool:
        """Return True if the base has to back off farther from ``origin``, and can.

        ``since`` is the time when it began, ``things`` are the obstacles around the base.
        """
        distance = math.hypot(pose.x - origin.x, pose.y - origin.y)
        room = free_distance(things, math.pi)
        return distance < BACK_OFF_DISTANCE and room > 0.0 and self.run.now() - since < BACK_OFF_TIMEOUT

    def _wait_shut_in(self) -> Status:
        now = self.run.now()
        if self._shut_in_since is None:
            self._shut_in_since = now
        if now - self._shut_in_since >= SHUT_IN_TIMEOUT:
            return self.fail("no way out")
        return self.steer(ZERO_VELOCITY, "no way out")

    def _activity(self, off: float) -> str:
        return (
            f"turning by {math.degrees(off):.0f} deg"
            if abs(off) >= MAX_DRIVING_ANGLE
            else f"{len(self._visited)} places visited"
        )
