"""Draws the simulated world from above, as a map: for films of runs, and to see what a world file describes."""

from collections.abc import Sequence
from math import cos, pi, sin
from unicodedata import normalize

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import BASE_RADIUS, Image, Pose2D
from drivers.sim.block import Block
from drivers.sim.looks import LOOKS
from drivers.sim.people import BODY, Place, Presence
from drivers.sim.room import Colour
from drivers.sim.things import Ball, Box, Rover
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import World

_AROUND: Colour = (236, 236, 232)
_FLOOR: Colour = (250, 248, 242)
_GRID: Colour = (232, 228, 218)
_WALL: Colour = (88, 84, 80)
_PIT: Colour = (52, 50, 54)
_INK: Colour = (60, 60, 64)
_ROBOT: Colour = (38, 96, 180)
_TRAIL: Colour = (110, 150, 210)
_DOCKING: Colour = (46, 140, 74)
_VIEW: Colour = (255, 214, 90)

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_SHIFT = 4  # bits of sub-pixel accuracy in OpenCV's drawing functions
_RAYS = 48  # to the end of what the camera sees
_FARTHEST = 6.0  # metres


class TopView:
    """Draws maps of one world into pictures of ``size`` (width, height): x to the right, y up.

    What never moves is drawn once. Not safe between threads.
    """

    def __init__(self, world: World, size: tuple[int, int] = (640, 480)) -> None:
        self._world = world
        self._size = size
        room = world.room
        margin = 0.35  # metres
        self._scale = min(size[0] / (room.length + 2 * margin), size[1] / (room.width + 2 * margin))
        self._letters = max(0.32, min(0.6, self._scale / 170))  # their size, in OpenCV's units
        self._empty: Image | None = None

    def draw(
        self,
        time: float,
        pose: Pose2D,
        *,
        camera: Viewpoint | None = None,
        field_of_view: float = pi / 3,
        trail: Sequence[Place] = (),
    ) -> Image:
        """Return the world at ``time`` seconds with the robot at ``pose``, (height, width, 3), blue, green, red.

        With ``camera``, what is in its horizontal ``field_of_view`` (radians), as far as nothing hides it. ``trail`` is
        where the robot has been.
        """
        if self._empty is None:
            self._empty = self._still()
        image = self._empty.copy()
        if camera is not None:
            self._light(image, self._seen(camera, field_of_view, time))
        if len(trail) > 1:
            cv2.polylines(image, [self._pixels(trail)], False, _bgr(_TRAIL), 2, cv2.LINE_AA, _SHIFT)
        for rover in self._world.robots:
            self._rover(image, rover, time)
        for presence in self._world.people_at(time):
            self._person(image, presence, pose)
        self._robot(image, pose)
        return image

    def _still(self) -> Image:
        """Draw what never moves."""
        room = self._world.room
        image: Image = np.full((self._size[1], self._size[0], 3), _bgr(_AROUND), np.uint8)
        floor = Block(*room.centre, room.length, room.width)
        self._block(image, Block(*room.centre, room.length + 0.16, room.width + 0.16), _WALL, None)
        self._block(image, floor, _FLOOR, None)
        self._grid(image)
        for edge in self._world.edges:
            self._block(image, Block(edge.x, edge.y, edge.length, edge.width), _PIT, None)
            for across in np.arange(-edge.length / 2 + 0.15, edge.length / 2, 0.15):
                x, low, high = edge.x + across, edge.y - edge.width / 2, edge.y + edge.width / 2
                self._line(image, (x, low), (x, high), (100, 98, 104))
        for wall in self._world.walls:
            self._block(image, wall.solid(), _WALL, None)
        # What is lower is hidden by what is higher: a ball lies on a table.
        for thing in sorted((*self._world.furniture, *self._world.things), key=lambda it: it.solid().top):
            if isinstance(thing, Ball):
                self._disc(image, (thing.x, thing.y), thing.size / 2, thing.colour, _INK)
            else:
                self._block(image, thing.solid(), thing.colour, _INK)
        for thing in (*self._world.furniture, *self._world.things):
            self._name(image, thing)
        if self._world.dock is not None:
            self._line(image, *self._world.dock.way, _DOCKING, 2)
        return image

    def _grid(self, image: Image) -> None:
        """Draw a line for each metre."""
        (x_low, x_high), (y_low, y_high) = self._world.room.extent()
        for x in np.arange(np.ceil(x_low + 0.01), x_high):
            self._line(image, (x, y_low), (x, y_high), _GRID)
        for y in np.arange(np.ceil(y_low + 0.01), y_high):
            self._line(image, (x_low, y), (x_high, y), _GRID)

    def _seen(self, camera: Viewpoint, field_of_view: float, time: float) -> list[Place]:
        """Return the outline of what the camera sees."""
        outline = [(camera.x, camera.y)]
        for angle in np.linspace(-field_of_view / 2, field_of_view / 2, _RAYS):
            way = camera.yaw + float(angle)
            far = self._world.distance(camera.x, camera.y, way, time, _FARTHEST, height=camera.z)
            outline.append((camera.x + far * cos(way), camera.y + far * sin(way)))
        return outline

    def _light(self, image: Image, outline: Sequence[Place]) -> None:
        mask = np.zeros(image.shape[:2], np.uint8)
        cv2.fillPoly(mask, [self._pixels(outline)], 255, cv2.LINE_AA, _SHIFT)
        tinted = cv2.addWeighted(image, 0.62, np.full_like(image, _bgr(_VIEW)), 0.38, 0.0)
        cv2.copyTo(tinted, mask, image)

    def _person(self, image: Image, presence: Presence, robot: Pose2D) -> None:
        look = LOOKS[presence.person.look]
        here, way = (presence.x, presence.y), presence.direction(robot.x, robot.y)
        nose = (here[0] + 0.13 * cos(way), here[1] + 0.13 * sin(way))
        self._disc(image, here, BODY, look.shirt, _INK)
        self._disc(image, nose, 0.05, look.skin, None)
        self._disc(image, here, 0.12, look.hair_colour if look.hair != "bald" else look.skin, None)
        self._label(image, presence.person.name, (here[0], here[1] + BODY + 0.12), on=_FLOOR)

    def _name(self, image: Image, thing: Box | Ball) -> None:
        """Write what something is called: on it where there is room, else below it."""
        solid = thing.solid()
        half = self._written(thing.name)[0] / 2 / self._scale + 0.03
        if solid.nearest(solid.x + half, solid.y) == solid.nearest(solid.x - half, solid.y) == (0.0, 0.0):
            self._label(image, thing.name, (solid.x, solid.y), on=thing.colour)
        else:
            lowest = min(y for _, y in solid.corners()) if isinstance(solid, Block) else solid.y - solid.radius
            self._label(image, thing.name, (solid.x, lowest - 0.12), on=_FLOOR)

    def _rover(self, image: Image, rover: Rover, time: float) -> None:
        solid = rover.solid(time)
        self._block(image, solid, rover.colour, _INK)
        front = (solid.x + solid.cos * solid.length / 2, solid.y + solid.sin * solid.length / 2)
        self._line(image, (solid.x, solid.y), front, (255, 255, 255), 2)
        self._label(image, rover.name, (solid.x, solid.y + solid.reach + 0.1), on=_FLOOR)

    def _robot(self, image: Image, pose: Pose2D) -> None:
        self._disc(image, (pose.x, pose.y), BASE_RADIUS, _ROBOT, (20, 50, 100))
        tip = (pose.x + BASE_RADIUS * cos(pose.heading), pose.y + BASE_RADIUS * sin(pose.heading))
        self._line(image, (pose.x, pose.y), tip, (255, 255, 255), 2)

    # --- shapes, in metres --------------------------------------------------------------------------------------------

    def _pixels(self, places: Sequence[Place]) -> npt.NDArray[np.int32]:
        """Return the pixels (k, 2) of places, as OpenCV draws with ``_SHIFT``."""
        centre, half = np.array(self._world.room.centre), np.array(self._size) / 2
        flipped = (np.array(places) - centre) * (self._scale, -self._scale) + half
        pixels: npt.NDArray[np.int32] = np.rint(flipped * 2**_SHIFT).astype(np.int32)
        return pixels

    def _block(self, image: Image, block: Block, colour: Colour, rim: Colour | None) -> None:
        outline = self._pixels(block.corners())
        cv2.fillConvexPoly(image, outline, _bgr(colour), cv2.LINE_AA, _SHIFT)
        if rim is not None:
            cv2.polylines(image, [outline], True, _bgr(rim), 1, cv2.LINE_AA, _SHIFT)

    def _disc(self, image: Image, place: Place, radius: float, colour: Colour, rim: Colour | None) -> None:
        x, y = self._pixels([place])[0].tolist()
        size = round(radius * self._scale * 2**_SHIFT)
        cv2.circle(image, (x, y), size, _bgr(colour), -1, cv2.LINE_AA, _SHIFT)
        if rim is not None:
            cv2.circle(image, (x, y), size, _bgr(rim), 1, cv2.LINE_AA, _SHIFT)

    def _line(self, image: Image, start: Place, end: Place, colour: Colour, width: int = 1) -> None:
        first, second = self._pixels([start, end]).tolist()
        cv2.line(image, first, second, _bgr(colour), width, cv2.LINE_AA, _SHIFT)

    def _label(self, image: Image, text: str, middle: Place, *, on: Colour) -> None:
        """Write a name, light on what is dark."""
        wide, high = self._written(text)
        x, y = (self._pixels([middle])[0] / 2**_SHIFT).tolist()
        spot = (round(x - wide / 2), round(y + high / 2))
        colour = _bgr(_INK if sum(on) > 330 else (244, 244, 240))
        cv2.putText(image, _plain(text), spot, _FONT, self._letters, colour, 1, cv2.LINE_AA)

    def _written(self, text: str) -> tuple[int, int]:
        """Return the width and height of a name in pixels."""
        (wide, high), _ = cv2.getTextSize(_plain(text), _FONT, self._letters, 1)
        return wide, high


def _plain(text: str) -> str:
    """Return a name in the letters that OpenCV has."""
    return normalize("NFKD", text).encode("ascii", "ignore").decode()


def _bgr(colour: Colour) -> Colour:
    return colour[2], colour[1], colour[0]
