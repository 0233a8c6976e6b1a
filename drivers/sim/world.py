"""The simulated world: a room, its objects, its people, and the light, as functions of time."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain
from math import atan2, cos, hypot, inf, pi, sin

from drivers.api import Pose2D
from drivers.errors import BadRequest
from drivers.sim.people import EARSHOT, FloorPosition, Person, Presence
from drivers.sim.person_actions import ActionSchedule, PersonReply, RobotUtterance
from drivers.sim.room import Room
from drivers.sim.solids import Point3, Solid
from drivers.sim.world_objects import Edge, Rover, Wall, WorldBall, WorldBox, WorldDock

# The light in a simulated world, and how it changes with time.


@dataclass(frozen=True, slots=True)
class LightChange:
    """The light changes to ``level`` from ``at`` seconds on, linearly within ``duration`` seconds."""

    at: float
    level: float
    duration: float = 0.0


@dataclass(frozen=True, slots=True)
class Light:
    """Brightness over time: 1 is daylight. It starts at ``level`` and follows ``changes``.

    Each change starts from the level that the one before has reached. Raises BadRequest for a negative level or
    duration, and for changes that are not in order of time.
    """

    level: float = 1.0
    changes: tuple[LightChange, ...] = ()

    def __post_init__(self) -> None:
        before = 0.0
        for level in (self.level, *(change.level for change in self.changes)):
            if not level >= 0:
                raise BadRequest(f"world: light {level}: must not be negative")
        for change in self.changes:
            if change.duration < 0 or not change.at >= before:
                raise BadRequest(
                    f"world: light change at {change.at} s over {change.duration} s: "
                    "changes must be sorted by time, and not have a negative duration"
                )
            before = change.at

    def level_at(self, time: float) -> float:
        """Return the brightness at ``time`` seconds."""
        level = self.level
        for number, change in enumerate(self.changes):
            if change.at > time:
                break
            until = time if number + 1 == len(self.changes) else min(time, self.changes[number + 1].at)
            share = 1.0 if until - change.at >= change.duration else (until - change.at) / change.duration
            level += share * (change.level - level)
        return level


DRIVE_UNDER_HEIGHT = 0.5
"""Minimum height of an object above the floor, in metres, at which a base can drive under it."""

ORIGIN = Pose2D(0.0, 0.0, 0.0)
"""Default start pose of a robot."""

MOUTH_HEIGHT = 1.0
"""Metres above the floor at which a robot speaks and hears."""

SENSOR_HEIGHT = 0.2
"""Default height of a range finder above the floor, in metres."""


@dataclass(frozen=True, slots=True)
class SimulatedWorld:
    """Everything that a simulated robot can see, hear and collide with; a ``drivers.sim.world_objects.Ground``.

    An immutable value, except for ``deliver_speech``, which triggers actions of people. So the world is a function of
    the time and of the speech so far. ``light`` is 1 in daylight. ``start`` is the robot's start pose. Not thread-safe
    while ``deliver_speech`` runs. Raises BadRequest if a person's position or path leaves the room, for two people with
    one name, and for a negative light.
    """

    room: Room = field(default_factory=Room)
    people: tuple[Person, ...] = ()
    light: float | Light = 1.0
    walls: tuple[Wall, ...] = ()
    furniture: tuple[WorldBox, ...] = ()
    edges: tuple[Edge, ...] = ()
    objects: tuple[WorldBox | WorldBall, ...] = ()
    robots: tuple[Rover, ...] = ()
    dock: WorldDock | None = None
    start: Pose2D = ORIGIN
    _light: Light = field(init=False, repr=False, compare=False)
    _object_solids: tuple[Solid, ...] = field(init=False, repr=False, compare=False)
    _static_solids: tuple[Solid, ...] = field(
        init=False, repr=False, compare=False
    )  # with the bodies of those who stay
    _room_extent: tuple[tuple[float, float], tuple[float, float]] = field(init=False, repr=False, compare=False)
    _schedules: tuple[ActionSchedule, ...] = field(init=False, repr=False, compare=False)
    _utterances: list[RobotUtterance] = field(init=False, repr=False, compare=False, default_factory=list)

    def __post_init__(self) -> None:
        light = self.light if isinstance(self.light, Light) else Light(self.light)
        still = (thing.solid() for thing in chain(self.walls, self.furniture, self.things))
        object.__setattr__(self, "_light", light)  # the way to fill in a field of a frozen class
        object.__setattr__(self, "_object_solids", tuple(still))
        object.__setattr__(
            self, "_schedules", tuple(ActionSchedule(person.name, person.acts) for person in self.people)
        )
        stands = (person.presence_at(0.0, (), self.room) for person in self.people if person.is_static)
        bodies = (presence.body_solid() for presence in stands if presence is not None)
        object.__setattr__(self, "_static_solids", (*self._object_solids, *bodies))
        object.__setattr__(self, "_room_extent", self.room.extent())
        twice = [name for name, count in Counter(person.name for person in self.people).items() if count > 1]
        if twice:
            raise BadRequest(f"world: more than one person is called {', '.join(twice)}")
        (x_low, x_high), (y_low, y_high) = self.room.extent()
        for person in self.people:
            for x, y in ((person.x, person.y), *person.path):
                if not self.room.contains(x, y):
                    raise BadRequest(
                        f"world: {person.name} at ({x:g}, {y:g}) m is outside the room",
                        hint=f"the room is x {x_low:g}..{x_high:g} m, y {y_low:g}..{y_high:g} m",
                    )

    @property
    def things(self) -> tuple[WorldBox | WorldBall, ...]:
        """Objects of the world, and the dock."""
        return self.objects if self.dock is None else (*self.objects, self.dock.box)

    # --- how it is at a time ------------------------------------------------------------------------------------------

    def light_at(self, time: float) -> float:
        """Return the brightness at ``time`` seconds; 1 is daylight."""
        return self._light.level_at(time)

    def people_at(self, time: float) -> tuple[Presence, ...]:
        """Return the state of the people who are still there at ``time`` seconds, in the order of ``people``."""
        return tuple(self._presences(time))

    # --- what is said -------------------------------------------------------------------------------------------------

    @property
    def utterances(self) -> tuple[RobotUtterance, ...]:
        """Speech of the robot so far, each with the people within earshot."""
        return tuple(self._utterances)

    def deliver_speech(self, text: str, time: float, place: FloorPosition | None = None) -> tuple[PersonReply, ...]:
        """Let people hear speech of the robot at ``time``, and return their replies in order of time.

        People hear it who are near enough to ``place``, without an inner wall in between; if None, all of them do.
        """
        there = ((each.person, each) for each in self.people_at(time))
        reached = {
            person.name
            for person, each in there
            if place is None or self._is_in_earshot(place, each, person.hears_within)
        }
        listening = [
            (person.name, cues)
            for person, cues in zip(self.people, self._schedules, strict=True)
            if person.name in reached and cues.is_listening(time)
        ]
        self._utterances.append(RobotUtterance(text, time, tuple(name for name, _ in listening)))
        return _sort_replies(reply for _, cues in listening for reply in cues.on_speech(text, time))

    def is_audible(self, speaker: str, time: float, place: FloorPosition) -> bool:
        """Return whether a robot at ``place`` hears the person named ``speaker`` at ``time`` seconds."""
        return any(
            each.person.name == speaker and self._is_in_earshot(place, each, EARSHOT) for each in self.people_at(time)
        )

    def _is_in_earshot(self, at: FloorPosition, presence: Presence, within: float) -> bool:
        """Return whether a robot at ``at`` and a person can hear each other.

        They can if they are at most ``within`` metres apart, with no inner wall between them.
        """
        robot, head = (*at, MOUTH_HEIGHT), (presence.x, presence.y, presence.eye_height)
        far = presence.distance(*at) > within
        return not far and not any(wall.solid().blocks_sight(robot, head) for wall in self.walls)

    def replies_between(self, after: float, until: float) -> tuple[PersonReply, ...]:
        """Return all speech of people later than ``after`` and up to ``until`` seconds."""
        return _sort_replies(reply for cues in self._schedules for reply in cues.replies_between(after, until))

    # --- what is in the way -------------------------------------------------------------------------------------------

    def contact_directions(self, x: float, y: float, radius: float, time: float) -> list[float]:
        """Return the directions (radians about z) in which a disc at (x, y) touches or overlaps a solid.

        The direction is that of the nearest point of the solid or, if the solid contains the middle of the disc, of the
        middle of the solid. Solids that a base can drive under are ignored.
        """
        (x_low, x_high), (y_low, y_high) = self._room_extent
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
            if solid.bottom < DRIVE_UNDER_HEIGHT:
                dx, dy = solid.nearest_offset(x, y)
                if hypot(dx, dy) <= radius:
                    found.append(atan2(dy, dx) if dx or dy else atan2(solid.y - y, solid.x - x))
        return found

    def has_floor(self, x: float, y: float) -> bool:
        return not any(edge.contains(x, y) for edge in self.edges)

    def distance(
        self, x: float, y: float, angle: float, time: float, limit: float = inf, *, height: float = SENSOR_HEIGHT
    ) -> float:
        """Return the metres from (x, y) to the nearest solid at ``angle``, at most ``limit``.

        The ray is ``height`` metres above the floor, as that of a range finder.
        """
        dx, dy = cos(angle), sin(angle)
        near = min(limit, self.room.intersect_ray(x, y, dx, dy))
        for solid in self.solids(time):
            if solid.bottom <= height <= solid.top:
                near = min(near, solid.intersect_ray(x, y, dx, dy))
        return near

    def is_visible(self, eye: Point3, point: Point3, time: float) -> bool:
        """Return whether the line from ``eye`` to ``point``, each (x, y, z), is free of walls, objects and people.

        A solid that contains ``point`` is ignored, so the middle of an object is visible if its surface is.
        """
        x, y, z = point
        if not self.room.contains(x, y):
            return False
        for solid in chain(self._object_solids, (rover.solid(time) for rover in self.robots)):
            if solid.blocks_sight(eye, point) and not (solid.bottom <= z <= solid.top and _covers(solid, x, y)):
                return False
        for presence in self._presences(time):
            body, head = presence.sight_solids()
            if (body.blocks_sight(eye, point) or head.blocks_sight(eye, point)) and not _covers(body, x, y):
                return False
        return True

    def _presences(self, time: float, *, staying: bool = True) -> Iterator[Presence]:
        """Yield the state of each person who has not left.

        If ``staying`` is False, people who never move are left out.
        """
        for person, cues in zip(self.people, self._schedules, strict=True):
            presence = (
                person.presence_at(time, cues.actions_until(time), self.room)
                if staying or not person.is_static
                else None
            )
            if presence is not None:
                yield presence

    def solids(self, time: float) -> Iterator[Solid]:
        """Yield the solid shape of every object and person at ``time`` seconds."""
        yield from self._static_solids
        for rover in self.robots:
            yield rover.solid(time)
        for presence in self._presences(time, staying=False):
            yield presence.body_solid()


def _covers(solid: Solid, x: float, y: float) -> bool:
    """Return whether (x, y) is in the footprint of a solid, or on its edge."""
    return hypot(*solid.nearest_offset(x, y)) < 0.01


def _sort_replies(replies: Iterator[PersonReply]) -> tuple[PersonReply, ...]:
    return tuple(sorted(replies, key=lambda reply: reply.time))
