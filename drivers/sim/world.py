"""The simulated world: a room, what stands in it, the people, and the light. Time is asked for, never kept."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain
from math import atan2, cos, hypot, inf, pi, sin

from drivers.api import Pose2D
from drivers.errors import BadRequest
from drivers.sim.acts import Cues, Heard, Reply
from drivers.sim.block import Point3, Solid
from drivers.sim.people import EARSHOT, Person, Place, Presence
from drivers.sim.room import Room
from drivers.sim.things import Ball, Box, Dock, Edge, Rover, Wall

# The light in a simulated world, and how it changes with time.


@dataclass(frozen=True, slots=True)
class Change:
    """From ``at`` seconds on the light goes to ``level``, evenly within ``over`` seconds."""

    at: float
    level: float
    over: float = 0.0


@dataclass(frozen=True, slots=True)
class Light:
    """How bright it is: 1 is daylight, 0.25 a quarter of it. ``level`` at first, then what ``changes`` make of it.

    Each change begins from what the one before it had reached. Raises BadRequest for a level or a length below 0, and
    for changes that are not in the order of time.
    """

    level: float = 1.0
    changes: tuple[Change, ...] = ()

    def __post_init__(self) -> None:
        before = 0.0
        for level in (self.level, *(change.level for change in self.changes)):
            if not level >= 0:
                raise BadRequest(f"world: light {level}: must not be negative")
        for change in self.changes:
            if change.over < 0 or not change.at >= before:
                raise BadRequest(f"world: light changes at {change.at} s over {change.over} s: not in order of time")
            before = change.at

    def at(self, time: float) -> float:
        """Return the level at ``time`` seconds."""
        level = self.level
        for number, change in enumerate(self.changes):
            if change.at > time:
                break
            until = time if number + 1 == len(self.changes) else min(time, self.changes[number + 1].at)
            share = 1.0 if until - change.at >= change.over else (until - change.at) / change.over
            level += share * (change.level - level)
        return level


TALL = 0.5
"""Metres: what begins higher than this above the floor, a base drives under."""

ORIGIN = Pose2D(0.0, 0.0, 0.0)
"""Where a robot starts of which nothing else is said."""

MOUTH = 1.0
"""Metres above the floor at which a robot speaks and hears."""

SENSOR_HEIGHT = 0.2
"""Metres above the floor at which a range finder sits, unless it says otherwise."""


@dataclass(frozen=True, slots=True)
class World:
    """Everything that a simulated robot can see, hear and bump into; meets ``drivers.sim.things.Ground``.

    A value, but for what has been said in it: ``hear`` adds to that, and people do what it makes them do. So what the
    world is like is a function of the time and of what was said. ``light`` is 1 in daylight, 0.25 for a quarter of it.
    ``start`` is where the robot stands at first. Not safe between threads while ``hear`` is called.
    Raises BadRequest when a person's place or path leaves the room, two people share a name, or ``light`` is negative.
    """

    room: Room = field(default_factory=Room)
    people: tuple[Person, ...] = ()
    light: float | Light = 1.0
    walls: tuple[Wall, ...] = ()
    furniture: tuple[Box, ...] = ()
    edges: tuple[Edge, ...] = ()
    objects: tuple[Box | Ball, ...] = ()
    robots: tuple[Rover, ...] = ()
    dock: Dock | None = None
    start: Pose2D = ORIGIN
    _light: Light = field(init=False, repr=False, compare=False)
    _solids: tuple[Solid, ...] = field(init=False, repr=False, compare=False)
    _still: tuple[Solid, ...] = field(init=False, repr=False, compare=False)  # with the bodies of those who stay
    _walls: tuple[tuple[float, float], tuple[float, float]] = field(init=False, repr=False, compare=False)
    _cues: tuple[Cues, ...] = field(init=False, repr=False, compare=False)
    _heard: list[Heard] = field(init=False, repr=False, compare=False, default_factory=list)

    def __post_init__(self) -> None:
        light = self.light if isinstance(self.light, Light) else Light(self.light)
        still = (thing.solid() for thing in chain(self.walls, self.furniture, self.things))
        object.__setattr__(self, "_light", light)  # the way to fill in a field of a frozen class
        object.__setattr__(self, "_solids", tuple(still))
        object.__setattr__(self, "_cues", tuple(Cues(person.name, person.acts) for person in self.people))
        stands = (person.presence(0.0, (), self.room) for person in self.people if person.stays)
        bodies = (presence.body() for presence in stands if presence is not None)
        object.__setattr__(self, "_still", (*self._solids, *bodies))
        object.__setattr__(self, "_walls", self.room.extent())
        twice = [name for name, count in Counter(person.name for person in self.people).items() if count > 1]
        if twice:
            raise BadRequest(f"world: more than one person is called {', '.join(twice)}")
        (x_low, x_high), (y_low, y_high) = self.room.extent()
        for person in self.people:
            for x, y in ((person.x, person.y), *person.path):
                if not self.room.inside(x, y):
                    raise BadRequest(
                        f"world: {person.name} at ({x:g}, {y:g}) m is outside the room",
                        hint=f"the room is x {x_low:g}..{x_high:g} m, y {y_low:g}..{y_high:g} m",
                    )

    @property
    def things(self) -> tuple[Box | Ball, ...]:
        """The objects, and the dock."""
        return self.objects if self.dock is None else (*self.objects, self.dock.box)

    # --- how it is at a time ------------------------------------------------------------------------------------------

    def light_at(self, time: float) -> float:
        """Return how bright it is: 1 is daylight."""
        return self._light.at(time)

    def people_at(self, time: float) -> tuple[Presence, ...]:
        """Return how everybody is who is still there at ``time`` seconds, in the order of ``people``."""
        return tuple(self._present(time))

    # --- what is said -------------------------------------------------------------------------------------------------

    @property
    def heard(self) -> tuple[Heard, ...]:
        """What has been said aloud so far."""
        return tuple(self._heard)

    def hear(self, text: str, time: float, at: Place | None = None) -> tuple[Reply, ...]:
        """Let people hear what the robot says at ``time``, and return what is answered, in the order of time.

        Those hear it who are near enough to the place ``at``, with no inner wall between; without a place, all who are
        there.
        """
        there = ((each.person, each) for each in self.people_at(time))
        reached = {person.name for person, each in there if at is None or self._carries(at, each, person.hears_within)}
        listening = [
            (person.name, cues)
            for person, cues in zip(self.people, self._cues, strict=True)
            if person.name in reached and cues.listens(time)
        ]
        self._heard.append(Heard(text, time, tuple(name for name, _ in listening)))
        return _in_order(reply for _, cues in listening for reply in cues.hear(text, time))

    def audible(self, who: str, time: float, at: Place) -> bool:
        """Say whether a robot at that place hears the one of the name ``who`` at ``time`` seconds."""
        return any(each.person.name == who and self._carries(at, each, EARSHOT) for each in self.people_at(time))

    def _carries(self, at: Place, presence: Presence, within: float) -> bool:
        """Say whether sound gets from the one to the other: so far, and through no inner wall."""
        robot, head = (*at, MOUTH), (presence.x, presence.y, presence.eyes)
        far = presence.distance(*at) > within
        return not far and not any(wall.solid().hides(robot, head) for wall in self.walls)

    def said(self, after: float, until: float) -> tuple[Reply, ...]:
        """Return all that people say, answers and else, later than ``after`` and up to ``until`` seconds."""
        return _in_order(reply for cues in self._cues for reply in cues.said(after, until))

    # --- what is in the way -------------------------------------------------------------------------------------------

    def touched(self, x: float, y: float, radius: float, time: float) -> list[float]:
        """Return the directions (radians about z) in which a disc at (x, y) touches or overlaps something solid.

        Of what the middle of the disc is in, the direction of its middle.
        """
        (x_low, x_high), (y_low, y_high) = self._walls
        found = []
        if x - radius <= x_low:
            found.append(pi)
        if x + radius >= x_high:
            found.append(0.0)
        if y - radius <= y_low:
            found.append(-pi / 2)
        if y + radius >= y_high:
            found.append(pi / 2)
        for solid in self.solids(time):
            if solid.bottom < TALL:
                dx, dy = solid.nearest(x, y)
                if hypot(dx, dy) <= radius:
                    found.append(atan2(dy, dx) if dx or dy else atan2(solid.y - y, solid.x - x))
        return found

    def has_floor(self, x: float, y: float) -> bool:
        """Say whether there is floor at (x, y)."""
        return not any(edge.holds(x, y) for edge in self.edges)

    def distance(
        self, x: float, y: float, angle: float, time: float, limit: float = inf, *, height: float = SENSOR_HEIGHT
    ) -> float:
        """Return the metres from (x, y) to the nearest solid thing at ``angle``, as far as ``limit``.

        It is what a range finder measures that sits ``height`` metres above the floor.
        """
        dx, dy = cos(angle), sin(angle)
        near = min(limit, self.room.ray(x, y, dx, dy))
        for solid in self.solids(time):
            if solid.bottom <= height <= solid.top:
                near = min(near, solid.ray(x, y, dx, dy))
        return near

    def visible(self, eye: Point3, point: Point3, time: float) -> bool:
        """Say whether nothing is between ``eye`` and ``point``, each (x, y, z): no wall, thing, nor body.

        What the point is in does not count, so that the middle of a thing is seen where its outside is.
        """
        x, y, z = point
        if not self.room.inside(x, y):
            return False
        for solid in chain(self._solids, (rover.solid(time) for rover in self.robots)):
            if solid.hides(eye, point) and not (solid.bottom <= z <= solid.top and _reaches(solid, x, y)):
                return False
        for presence in self._present(time):
            body, head = presence.outline()
            if (body.hides(eye, point) or head.hides(eye, point)) and not _reaches(body, x, y):
                return False
        return True

    def _present(self, time: float, *, staying: bool = True) -> Iterator[Presence]:
        """Yield how everybody is who is still there; those who always stay where they are only if ``staying``."""
        for person, cues in zip(self.people, self._cues, strict=True):
            presence = person.presence(time, cues.until(time), self.room) if staying or not person.stays else None
            if presence is not None:
                yield presence

    def solids(self, time: float) -> Iterator[Solid]:
        """Yield the shape of every thing and body that is in the way at ``time`` seconds."""
        yield from self._still
        for rover in self.robots:
            yield rover.solid(time)
        for presence in self._present(time, staying=False):
            yield presence.body()


def _reaches(solid: Solid, x: float, y: float) -> bool:
    """Say whether (x, y) is within the footprint of something, or on its edge."""
    return hypot(*solid.nearest(x, y)) < 0.01


def _in_order(replies: Iterator[Reply]) -> tuple[Reply, ...]:
    return tuple(sorted(replies, key=lambda reply: reply.when))
