"""Perfect detectors in the simulated world, with the noise of real ones."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product
from math import atan2, cos, hypot, pi, remainder, sin, tau
from random import Random

from config.world_items import PersonConfig
from drivers.sim.people import Presence
from drivers.sim.room import Colour
from drivers.sim.solids import Point3, Solid, UprightBox
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import MARKER_SIZE, Rover, WorldBall
from drivers.sim.world_objects import WorldBox as Crate
from perception.api import ANY, BALL, BOX, Box, Detection, ThingSpec
from perception.geometry import FACE_WIDTH, Pinhole
from perception.identity import FaceMatch
from perception.tracks import (
    BOX_WIDENING,
    MIN_SPOT_PIXELS,
    SEARCH_WIDTH,
    ColourSpot,
    FaceSighting,
    MarkerSet,
    MarkerSighting,
    ThingSighting,
)

# Names for eyes that know the world: what a recogniser would say of each face, mistakes now and then included.

LOOK_MARGIN = 1.0
"""Similarity above the recognition threshold that simulated faces of known people have; strangers have it below."""


class TrueNames:
    """Simulated face recognition that knows the people with ``known: true`` in the world file.

    A share ``mistaken`` (0..1) of the results is wrong.
    """

    def __init__(self, people: Iterable[PersonConfig], mistaken: float, random: Random) -> None:
        self._known = frozenset(person.name for person in people if person.known)
        self._mistaken = mistaken
        self._random = random

    def look(self, face: Box, sightings: Sequence[FaceSighting]) -> FaceMatch | None:
        """Return the recognition result for the face in the box ``face``, or None if no sighting has this box."""
        who = next((sighting.person for sighting in sightings if sighting.box == face), "")
        if not who:
            return None
        wrong = self._random.random() < self._mistaken
        return FaceMatch(who, LOOK_MARGIN if (who in self._known) is not wrong else -LOOK_MARGIN)


FACE_DROP = 0.03
"""Distance in metres from the eyes down to the middle of a face's Haar box, which reaches from hairline to chin."""

MIN_FACE_WIDTH = 28.0
"""Width of a face in pixels below which a detector does not find it (``perception.faces``)."""

MIN_MARKER_SIDE = 24.0
"""Side of a marker in pixels below which its number is unreadable: 4 for each of its cells."""

MARKER_HEIGHT = MARKER_SIZE * 4 / 3
"""Height in metres of a marker with its white rim, which hangs below a robot's upper edge (``drivers.sim.render``)."""


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """Errors of simulated detectors.

    ``missed`` is the share of missed faces or things, ``noise`` the error of boxes (one sigma, in pixels), ``mistaken``
    the share of wrong names.
    """

    missed: float = 0.02
    noise: float = 1.0
    mistaken: float = 0.03


class GroundTruth:
    """Perfect detectors in a world, seen by a camera with this ``lens``; ``noise`` adds realistic errors."""

    def __init__(self, world: SimulatedWorld, lens: Pinhole, noise: SensorNoise, random: Random) -> None:
        self._world = world
        self._lens = lens
        self._noise = noise
        self._random = random

    def faces(self, view: Viewpoint, now: float) -> tuple[FaceSighting, ...]:
        """Return the faces in view, largest first."""
        boxes = ((self._face(presence, view, now), presence.person.name) for presence in self._world.people_at(now))
        found = [FaceSighting(Detection(box, 5.0), found=True, person=who) for box, who in boxes if box is not None]
        return tuple(sorted(found, key=lambda sighting: -sighting.box.width))

    def things(
        self, view: Viewpoint, now: float, wanted: Sequence[ThingSpec], colours: Mapping[str, Colour]
    ) -> tuple[ThingSighting, ...]:
        """Return the things in view that match one of ``wanted``, also furniture of the same colour and shape.

        ``colours`` are the colours by name.
        """
        found = []
        for thing in chain(self._world.objects, self._world.furniture):
            shape = BALL if isinstance(thing, WorldBall) else BOX
            fitting = [
                one for one in wanted if colours[one.colour] == thing.colour and one.shape in (ANY, shape)
            ]  # most things are not looked for, and cost no more than this
            seen = self._thing(thing, view, now) if fitting else None
            if seen is not None:
                box, width = seen
                found += [ThingSighting(ColourSpot(box, one.colour, shape, width), one) for one in fitting]
        return tuple(found)

    def markers(self, view: Viewpoint, now: float, kind: MarkerSet) -> tuple[MarkerSighting, ...]:
        """Return the markers in view, of each robot the largest."""
        seen = (self._marker(rover, view, now, kind) for rover in self._world.robots)
        return tuple(one for one in seen if one is not None)

    def motion(self, view: Viewpoint, before: float, now: float) -> float:
        """Return the share of the picture (0..1) that changed since ``before`` (s) because people and robots moved."""
        then, changed = dict(self._moving(before)), 0.0
        for name, solid in self._moving(now):
            was = then.get(name)
            middle = (solid.x, solid.y, (solid.bottom + solid.top) / 2)
            place = self._pixel_of(view, middle)
            if was is None or place is None or not self._world.is_visible((view.x, view.y, view.z), middle, now):
                continue
            old = self._pixel_of(view, (was.x, was.y, (was.bottom + was.top) / 2))
            if old is None or not 0 <= place[0] <= self._lens.width:
                continue
            scale = self._lens.focal / view.to_camera_axes(*middle)[2]
            high = min((solid.top - solid.bottom) * scale, self._lens.height)
            changed += 2 * high * min(hypot(place[0] - old[0], place[1] - old[1]), 2 * solid.bounding_radius * scale)
        return min(1.0, changed / (self._lens.width * self._lens.height))

    def _moving(self, time: float) -> Iterator[tuple[str, Solid]]:
        for presence in self._world.people_at(time):
            yield presence.person.name, presence.body_solid()
        for rover in self._world.robots:
            yield rover.name, rover.solid(time)

    def _face(self, presence: Presence, view: Viewpoint, now: float) -> Box | None:
        """Return the box of a face in the picture, or None if it is hidden or missed."""
        if not presence.shows_face(view.x, view.y):
            return None
        middle = (presence.x, presence.y, presence.eye_height - FACE_DROP)
        _, _, ahead = view.to_camera_axes(*middle)
        if ahead <= 0:
            return None
        half = FACE_WIDTH / 2
        width = 2 * half * self._lens.focal / ahead
        seen = self._pixel_of(view, middle)
        if seen is None or width < MIN_FACE_WIDTH:
            return None
        return self._detected_box(Box(seen[0] - width / 2, seen[1] - width / 2, width, width), view, middle, now)

    def _thing(self, thing: WorldBall | Crate, view: Viewpoint, now: float) -> tuple[Box, float] | None:
        """Return the box of a thing in the picture, and its apparent width in pixels.

        None if the thing is hidden, missed or too small.
        """
        solid = thing.solid()
        middle = (thing.x, thing.y, (solid.bottom + solid.top) / 2)
        _, _, ahead = view.to_camera_axes(*middle)
        if isinstance(thing, WorldBall):
            place = self._pixel_of(view, middle)
            width = thing.size * self._lens.focal / max(ahead, 0.01)
            around = None if place is None else Box(place[0] - width / 2, place[1] - width / 2, width, width)
        else:
            around = self._bounding_box(view, _corners(thing.solid()))
            width = 0.0 if around is None else around.width / BOX_WIDENING
        least = MIN_SPOT_PIXELS * self._lens.width / SEARCH_WIDTH
        if around is None or min(around.width, around.height) < least:
            return None
        box = self._detected_box(around, view, middle, now)
        return None if box is None else (box, width)

    def _marker(self, rover: Rover, view: Viewpoint, now: float, kind: MarkerSet) -> MarkerSighting | None:
        """Return the marker on the side of a robot that faces the camera most.

        None if it is hidden, or too small to read.
        """
        solid = rover.solid(now)
        x, y, facing = max(_sides(solid), key=lambda side: cos(_side_angle(side, view)))
        angle = _side_angle((x, y, facing), view)
        height = max(solid.top / 2, solid.top - MARKER_HEIGHT / 2 - 0.03)
        middle = (x, y, height)
        _, _, ahead = view.to_camera_axes(*middle)
        place = self._pixel_of(view, middle)
        width = MARKER_SIZE * self._lens.focal * cos(angle) / max(ahead, 0.01)
        if place is None or width < MIN_MARKER_SIDE:
            return None
        side = width / cos(angle)
        box = self._detected_box(Box(place[0] - width / 2, place[1] - side / 2, width, side), view, middle, now)
        if box is None:
            return None
        away = hypot(x - view.x, y - view.y, height - view.z)
        return MarkerSighting(rover.marker, kind.robots.get(rover.marker, ""), box, away, angle)

    def _pixel_of(self, view: Viewpoint, point: Point3) -> tuple[float, float] | None:
        """Return the pixel (x, y) of a point, or None behind the camera."""
        right, down, ahead = view.to_camera_axes(*point)
        if ahead <= 0.01:
            return None
        lens = self._lens
        return lens.width / 2 + lens.focal * right / ahead, lens.height / 2 + lens.focal * down / ahead

    def _bounding_box(self, view: Viewpoint, points: Iterator[Point3]) -> Box | None:
        """Return the box around some points, or None if one is behind the camera."""
        places = [self._pixel_of(view, point) for point in points]
        inside = [place for place in places if place is not None]
        if len(inside) < len(places):
            return None
        xs, ys = zip(*inside, strict=True)
        return Box(min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys))

    def _detected_box(self, box: Box, view: Viewpoint, middle: Point3, now: float) -> Box | None:
        """Return ``box`` with detector noise, or None if the object in it is cut off, hidden or missed."""
        random, noise, lens = self._random, self._noise.noise, self._lens
        x, y = box.x + random.gauss(0.0, noise), box.y + random.gauss(0.0, noise)
        inside = 0 <= x <= lens.width - box.width and 0 <= y <= lens.height - box.height
        if not inside or random.random() < self._noise.missed:
            return None
        if not self._world.is_visible((view.x, view.y, view.z), middle, now):
            return None
        return Box(x, y, box.width, box.height)


def _corners(block: UprightBox) -> Iterator[Point3]:
    """Yield the eight corners (x, y, z) of ``block`` in metres."""
    for (x, y), z in product(block.corners(), (block.bottom, block.top)):
        yield x, y, z


def _sides(block: UprightBox) -> Iterator[tuple[float, float, float]]:
    """Yield the middle (x, y) and direction (radians about z) of each side of a box."""
    for quarter in range(4):
        facing = block.heading + quarter * pi / 2
        half = (block.width if quarter % 2 else block.length) / 2
        yield block.x + half * cos(facing), block.y + half * sin(facing), facing


def _side_angle(side: tuple[float, float, float], view: Viewpoint) -> float:
    """Return the angle between a side's direction and the camera in radians, positive to the side's left."""
    x, y, facing = side
    return remainder(facing - atan2(view.y - y, view.x - x), tau)
