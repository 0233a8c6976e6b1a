"""The leaf that drives about and runs into nothing."""

import math
from collections import deque

from py_trees.common import Status

from behaviours.clearance import CLEARANCE_MARGIN, ObstacleView, Points, free_distance, rotate_points, safe_speed
from behaviours.driving.motion import REACTION_TIME, BaseMotion
from behaviours.leaf import FAILURE, argument
from drivers.api import BASE_RADIUS, ZERO_VELOCITY, BaseState, Pose2D, Sides, Steering, Velocity

# Where a base has been, and what of the floor it has not seen yet.

CELL_SIZE = 0.25
"""Metres from one side of a cell to the other."""


class VisitedCells:
    """A grid of cells on the floor, in the frame of the odometry, that the middle of a base has come to."""

    def __init__(self) -> None:
        self._cells: set[tuple[int, int]] = set()

    def __len__(self) -> int:
        return len(self._cells)

    def visit(self, pose: Pose2D) -> None:
        """Take in where the base is."""
        self._cells.add(_cell(pose.x, pose.y))

    def unvisited_share(self, pose: Pose2D, heading: float, length: float) -> float:
        """Return the share 0..1 of the next ``length`` metres in a ``heading`` that lies in new cells."""
        steps = int(length / CELL_SIZE)
        c, s = CELL_SIZE * math.cos(heading), CELL_SIZE * math.sin(heading)
        new = sum(_cell(pose.x + k * c, pose.y + k * s) not in self._cells for k in range(1, steps + 1))
        return new / steps if steps else 0.0


def _cell(x: float, y: float) -> tuple[int, int]:
    return math.floor(x / CELL_SIZE), math.floor(y / CELL_SIZE)


BLIND_SPEED = 0.1
"""m/s at most without a range finder: as fast as it may bump into something."""

BACK_OFF_DISTANCE, BACK_OFF_SPEED, BACK_OFF_TIMEOUT = 0.15, 0.1, 4.0
"""Metres that it drives straight back after a bump or from an edge, how fast, and for how long (s) at most."""

HEADINGS = [math.radians(degrees) for degrees in range(-180, 180, 10)]
"""The ways that it chooses from, from straight ahead."""

MAX_USEFUL_DISTANCE = 3.0
"""Metres: more than that ahead is no better."""

SWITCH_FACTOR = 1.25
"""How many times better another way must be than the one that it goes."""

CHOICE_INTERVAL = 0.4
"""Seconds after which it thinks about its way anew."""

MAX_DRIVING_ANGLE = math.radians(30)
"""So far beside its way it only turns."""

TURN_GAIN, MAX_TURN_RATE = 2.0, math.radians(80)
"""rad/s for each radian beside its way, and rad/s at most."""

SHUT_IN_TIMEOUT = 5.0
"""Seconds without a way out after which it gives up."""

MAX_REMEMBERED_HITS = 60
"""How many of the places where it bumped, or found an edge, it keeps in mind."""

_BUMPERS = {"left": math.radians(55), "centre": 0.0, "right": math.radians(-55)}


class Wander(BaseMotion):
    """Drive about without running into things, and where it has not been rather than where it has.

    With a range finder it sees things in time, as far as they are as high as that. Without one it drives at 0.1 m/s at
    most, and finds out by its bumpers. From a bump or an edge it drives straight back, and remembers the place.
    Running all the time; it never succeeds. Fails when there is no way out, when a wheel drops, and while the base is
    stopped until somebody enables it. While somebody steers the base by hand it waits.
    """

    tag = "wander"
    optional_parts = frozenset({"range"})
    ends = frozenset({"failure"})
    speed: float = argument("speed", "how fast", default=0.3, low=0.05, high=0.7)
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
        seen = self._lookout.points_around(state, self.run.now())
        if seen is None and self.robot.ranger_part is not None:
            return self.steer(ZERO_VELOCITY, "waiting for the range finder")
        things = self._obstacles(state.pose, seen)
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
            Velocity(self._speed(off, free_distance(things), blind=seen is None), turn), self._activity(off)
        )
        if status is FAILURE:  # an edge that is not far enough behind it
            self._last_hit = state.pose, self.run.now()
            return self._wait_shut_in()
        if self._refused_since is None:
            self._shut_in_since = None
        return status

    # --- where to ---------------------------------------------------------------------------------------------------

    def _choose(self, pose: Pose2D, things: Points) -> float | None:
        """Return the heading to keep: a new one where the present one is blocked, or another is much better."""
        ways = [free_distance(things, heading) for heading in HEADINGS]
        if max(ways) <= CLEARANCE_MARGIN:
            return None
        value = [self._score(pose, heading, way) for heading, way in zip(HEADINGS, ways, strict=True)]
        best = value.index(max(value))
        if self._course is not None:
            kept = math.remainder(self._course - pose.heading, math.tau)
            way = free_distance(things, kept)
            if way > CLEARANCE_MARGIN and self._score(pose, kept, way) * SWITCH_FACTOR >= value[best]:
                return self._course
        return pose.heading + HEADINGS[best]

    def _score(self, pose: Pose2D, heading: float, way: float) -> float:
        """Return what a way is worth: how far it leads, how much of that is new, how little one has to turn."""
        length = min(way, MAX_USEFUL_DISTANCE)
        new = self._visited.unvisited_share(pose, pose.heading + heading, length)
        return length * (0.2 + new) * (1.0 - 0.4 * abs(heading) / math.pi)

    def _speed(self, off: float, way: float, *, blind: bool) -> float:
        """Return how fast it may drive with so much room ahead, and so far off its course."""
        safe = safe_speed(way, braking=self.braking, reaction=REACTION_TIME)
        return min(self.speed, safe, BLIND_SPEED if blind else math.inf) * max(0.0, 1.0 - abs(off) / MAX_DRIVING_ANGLE)

    # --- what is there ----------------------------------------------------------------------------------------------

    def _obstacles(self, pose: Pose2D, seen: Points | None) -> Points:
        """Return all that is to be gone round: what is seen, and what was met before."""
        known = rotate_points([(x - pose.x, y - pose.y) for x, y in self._hits], pose.heading)
        return known if seen is None else seen + known

    def _remember_hit(self, pose: Pose2D, where: Sides) -> None:
        """Remember a thing, or an edge, at the rim of the base, and begin to drive back from it."""
        sides = [angle for name, angle in _BUMPERS.items() if getattr(where, name)]
        if self._last_hit is None:
            for angle in sides:
                place = pose.heading + angle
                self._hits.append((pose.x + BASE_RADIUS * math.cos(place), pose.y + BASE_RADIUS * math.sin(place)))
        self._last_hit, self._course = (self._last_hit or (pose, self.run.now())), None

    def _must_back_off(self, pose: Pose2D, origin: Pose2D, since: float, things: Points) -> bool:
        """Say whether it has to drive farther back, and can."""
        gone = math.hypot(pose.x - origin.x, pose.y - origin.y)
        room = free_distance(things, math.pi)
        return gone < BACK_OFF_DISTANCE and room > 0.0 and self.run.now() - since < BACK_OFF_TIMEOUT

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
