"""People in a simulated world: their looks, and their positions over time."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import accumulate, groupby, pairwise
from math import atan2, cos, dist, hypot, isfinite, pi, radians

from drivers.errors import BadRequest
from drivers.sim.appearances import APPEARANCES
from drivers.sim.person_actions import Facing, PersonAction, ScheduledAction, eye_drop
from drivers.sim.room import Room
from drivers.sim.solids import UprightCylinder

# Going along waypoints: where somebody is at any time, and which way they go.

FloorPosition = tuple[float, float]
"""A position (x, y) on the floor, in metres."""


@dataclass(frozen=True, slots=True)
class WaypointPath:
    """Path through ``waypoints`` at ``speed`` m/s, starting at ``start`` seconds.

    With ``loop`` it returns to the first waypoint and repeats, otherwise it ends at the last one.
    """

    waypoints: tuple[FloorPosition, ...]
    speed: float
    start: float = 0.0
    loop: bool = True
    _leg_ends: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        stops = (*self.waypoints, self.waypoints[0]) if self.loop else self.waypoints
        stops = tuple(stop for stop, _ in groupby(stops))  # so that no leg is without length
        lengths = (dist(a, b) for a, b in pairwise(stops))
        object.__setattr__(self, "waypoints", stops)  # the way to fill in a field of a frozen class
        object.__setattr__(self, "_leg_ends", tuple(accumulate(lengths, initial=0.0)))

    def position_at(self, time: float) -> FloorPosition:
        """Return the position (x, y) in metres at ``time`` seconds."""
        leg, done = self._leg(time)
        if done == 0.0:
            return self.waypoints[leg]
        (x0, y0), (x1, y1) = self.waypoints[leg], self.waypoints[leg + 1]
        share = done / (self._leg_ends[leg + 1] - self._leg_ends[leg])
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)

    def heading_at(self, time: float) -> float | None:
        """Return the direction of travel at ``time`` seconds (radians about z); None for a path of one waypoint.

        Before the start it is the direction of the first leg, after the end that of the last.
        """
        if len(self.waypoints) < 2:
            return None
        leg = min(self._leg(time)[0], len(self.waypoints) - 2)
        (x0, y0), (x1, y1) = self.waypoints[leg], self.waypoints[leg + 1]
        return atan2(y1 - y0, x1 - x0)

    def _leg(self, time: float) -> tuple[int, float]:
        """Return the index of the waypoint that was passed last before ``time``, and the metres walked since then."""
        total = self._leg_ends[-1]
        walked = (time - self.start) * self.speed
        if walked <= 0.0 or total == 0.0:
            return 0, 0.0
        if self.loop:
            walked %= total
        elif walked >= total:
            return len(self.waypoints) - 1, 0.0
        leg = bisect_right(self._leg_ends, walked) - 1
        return leg, walked - self._leg_ends[leg]


BODY_RADIUS = 0.25
"""Metres from the middle of a person to the contact with a robot."""

EARSHOT = 4.0
"""Metres within which people and robots hear each other by default."""

_SHOULDER_DROP, _CROWN_HEIGHT, _HEAD_RADIUS = (
    0.18,
    0.12,
    0.11,
)  # metres: shoulders below the eyes, crown above them, half the width of a head
_MIN_FACE_COSINE = cos(radians(60.0))  # of the angle by which somebody is turned away from the camera


@dataclass(frozen=True, slots=True)
class Person:
    """A person at (x, y), or walking from there along ``path``.

    ``look`` is a key of ``drivers.sim.appearances.APPEARANCES``; ``height`` is that of the eyes above the floor, in
    metres. ``facing`` is an angle about z in radians, ``camera`` (always towards the robot's camera) or ``away``
    (always away from it). From ``start`` seconds on, the person walks through the waypoints of ``path`` (x, y in
    metres) at ``speed`` m/s, with ``loop`` back to (x, y) and round again. ``acts`` are further actions. The person
    hears the robot within ``hears_within`` metres. Raises BadRequest for an unknown look, a height outside 0.8..2.1 m,
    a speed of 0 or less, and infinite numbers.
    """

    name: str
    look: str = "anna"
    x: float = 1.5
    y: float = 0.0
    height: float = 1.6
    facing: Facing = "camera"
    path: tuple[FloorPosition, ...] = ()
    speed: float = 0.5
    start: float = 0.0
    loop: bool = True
    acts: tuple[PersonAction, ...] = ()
    hears_within: float = EARSHOT
    walk: WaypointPath = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.look not in APPEARANCES:
            raise BadRequest(f"{self.name}: no look named '{self.look}'", hint="looks: " + ", ".join(APPEARANCES))
        if not 0.8 <= self.height <= 2.1:
            raise BadRequest(f"{self.name}: eyes at {self.height} m: must be within 0.8..2.1 m")
        if not (isfinite(self.speed) and self.speed > 0):
            raise BadRequest(f"{self.name}: walks at {self.speed} m/s: must be above 0 m/s")
        numbers = (self.x, self.y, self.start, *(value for point in self.path for value in point))
        if not all(map(isfinite, numbers)):
            raise BadRequest(f"{self.name}: place, path or start is not finite: {numbers}")
        walk = WaypointPath(((self.x, self.y), *self.path), self.speed, self.start, self.loop)
        object.__setattr__(self, "walk", walk)  # the way to fill in a field of a frozen class

    @property
    def is_static(self) -> bool:
        """True if the person never moves."""
        return not (self.path or self.acts)

    def position_at(self, time: float) -> FloorPosition:
        """Return the position on the path, (x, y) in metres, at ``time`` seconds."""
        return self.walk.position_at(time)

    def presence_at(self, time: float, actions: Sequence[ScheduledAction], room: Room) -> "Presence | None":
        """Return the person's state at ``time`` seconds, after the given ``actions``; None once the person has left."""
        facing, nod = self.facing, 0.0
        for cue in actions:
            if cue.action.turn is not None:
                facing = cue.action.turn
            if cue.action.nod:
                nod = eye_drop(time - cue.time)
            if cue.action.leave:
                return self._leaving_presence(time - cue.time, self.walk.position_at(cue.time), room)
        return Presence(self, *self.walk.position_at(time), facing, self.height - nod)

    def _leaving_presence(self, elapsed: float, here: FloorPosition, room: Room) -> "Presence | None":
        """Return the state of a person who walks from ``here`` to the nearest wall to leave; None once there.

        ``elapsed`` is the time in seconds since the person set out.
        """
        (x0, y0), (x1, y1) = here, room.nearest_wall(*here)
        away, walked = dist(here, (x1, y1)), elapsed * self.speed
        if walked >= away:
            return None
        share = walked / away
        place = (x0 + share * (x1 - x0), y0 + share * (y1 - y0))
        return Presence(self, *place, atan2(y1 - y0, x1 - x0), self.height)


@dataclass(frozen=True, slots=True)
class Presence:
    """State of a person at one time: at (x, y), turned to ``facing``, eyes at ``eye_height`` metres above the floor."""

    person: Person
    x: float
    y: float
    facing: Facing
    eye_height: float

    def distance(self, x: float, y: float) -> float:
        """Return the distance from (x, y) along the floor, in metres."""
        return hypot(self.x - x, self.y - y)

    def direction(self, x: float, y: float) -> float:
        """Return the direction in which the person is turned (radians about z), for an observer at (x, y)."""
        if not isinstance(self.facing, str):
            return self.facing
        return atan2(y - self.y, x - self.x) + (pi if self.facing == "away" else 0.0)

    def shows_face(self, x: float, y: float) -> bool:
        """Return whether the face is visible from (x, y): the person is turned to that point, within 60 degrees."""
        if isinstance(self.facing, str):
            return self.facing == "camera"
        return cos(self.facing - atan2(y - self.y, x - self.x)) >= _MIN_FACE_COSINE

    def body_solid(self) -> UprightCylinder:
        """Return the solid that a base collides with."""
        return UprightCylinder(self.x, self.y, BODY_RADIUS, 0.0, self.eye_height + _CROWN_HEIGHT)

    def sight_solids(self) -> tuple[UprightCylinder, UprightCylinder]:
        """Return the solids that block sight: the body up to the shoulders, and the head."""
        shoulders = self.eye_height - _SHOULDER_DROP
        return (
            UprightCylinder(self.x, self.y, BODY_RADIUS, 0.0, shoulders),
            UprightCylinder(self.x, self.y, _HEAD_RADIUS, shoulders, self.eye_height + _CROWN_HEIGHT),
        )
