"""Top view of the simulated world: a map for films of runs and pictures of world files."""

from collections.abc import Sequence
from math import cos, pi, sin
from unicodedata import normalize

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import BASE_RADIUS, Image, Pose2D
from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import BODY_RADIUS, FloorPosition, Presence
from drivers.sim.room import Colour
from drivers.sim.solids import UprightBox
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import Rover, WorldBall, WorldBox

_BACKGROUND: Colour = (236, 236, 232)
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
_RAY_COUNT = 48  # to the end of what the camera sees
_MAX_VIEW_RANGE = 6.0  # metres


class TopView:
    """Draws maps of one world in pictures of ``size`` (width, height): x to the right, y up.

    Static objects are drawn once. Not thread-safe.
    """

    def __init__(self, world: SimulatedWorld, size: tuple[int, int] = (640, 480)) -> None:
        self._world = world
        self._size = size
        room = world.room
        margin = 0.35  # metres
        self._scale = min(size[0] / (room.length + 2 * margin), size[1] / (room.width + 2 * margin))
        self._font_size = max(0.32, min(0.6, self._scale / 170))  # their size, in OpenCV's units
        self._static_map: Image | None = None

    def draw(
        self,
        time: float,
        pose: Pose2D,
        *,
        camera: Viewpoint | None = None,
        field_of_view: float = pi / 3,
        trail: Sequence[FloorPosition] = (),
    ) -> Image:
        """Return the world at ``time`` seconds with the robot at ``pose``: (height, width, 3), blue, green, red.

        With ``camera``, the visible part of its horizontal ``field_of_view`` (radians) is tinted. ``trail`` is the
        robot's path.
        """
        if self._static_map is None:
            self._static_map = self._draw_static()
        image = self._static_map.copy()
        if camera is not None:
            self._tint_area(image, self._view_outline(camera, field_of_view, time))
        if len(trail) > 1:
            cv2.polylines(image, [self._pixels(trail)], False, _bgr(_TRAIL), 2, cv2.LINE_AA, _SHIFT)
        for rover in self._world.robots:
            self._draw_rover(image, rover, time)
        for presence in self._world.people_at(time):
            self._draw_person(image, presence, pose)
        self._draw_robot(image, pose)
        return image

    def _draw_static(self) -> Image:
        """Return a map of all objects that never move."""
        room = self._world.room
        image: Image = np.full((self._size[1], self._size[0], 3), _bgr(_BACKGROUND), np.uint8)
        floor = UprightBox(*room.centre, room.length, room.width)
        self._draw_box(image, UprightBox(*room.centre, room.length + 0.16, room.width + 0.16), _WALL, None)
        self._draw_box(image, floor, _FLOOR, None)
        self._draw_grid(image)
        for edge in self._world.edges:
            self._draw_box(image, UprightBox(edge.x, edge.y, edge.length, edge.width), _PIT, None)
            for across in np.arange(-edge.length / 2 + 0.15, edge.length / 2, 0.15):
                x, low, high = edge.x + across, edge.y - edge.width / 2, edge.y + edge.width / 2
                self._draw_line(image, (x, low), (x, high), (100, 98, 104))
        for wall in self._world.walls:
            self._draw_box(image, wall.solid(), _WALL, None)
        # What is lower is hidden by what is higher: a ball lies on a table.
        for thing in sorted((*self._world.furniture, *self._world.things), key=lambda it: it.solid().top):
            if isinstance(thing, WorldBall):
                self._draw_disc(image, (thing.x, thing.y), thing.size / 2, thing.colour, _INK)
            else:
                self._draw_box(image, thing.solid(), thing.colour, _INK)
        for thing in (*self._world.furniture, *self._world.things):
            self._label_object(image, thing)
        if self._world.dock is not None:
            self._draw_line(image, *self._world.dock.approach_line, _DOCKING, 2)
        return image

    def _draw_grid(self, image: Image) -> None:
        """Draw a line for each metre."""
        (x_low, x_high), (y_low, y_high) = self._world.room.extent()
        for x in np.arange(np.ceil(x_low + 0.01), x_high):
            self._draw_line(image, (x, y_low), (x, y_high), _GRID)
        for y in np.arange(np.ceil(y_low + 0.01), y_high):
            self._draw_line(image, (x_low, y), (x_high, y), _GRID)

    def _view_outline(self, camera: Viewpoint, field_of_view: float, time: float) -> list[FloorPosition]:
        """Return the outline of the visible area of the camera."""
        outline = [(camera.x, camera.y)]
        for angle in np.linspace(-field_of_view / 2, field_of_view / 2, _RAY_COUNT):
            way = camera.yaw + float(angle)
            far = self._world.distance(camera.x, camera.y, way, time, _MAX_VIEW_RANGE, height=camera.z)
            outline.append((camera.x + far * cos(way), camera.y + far * sin(way)))
        return outline

    def _tint_area(self, image: Image, outline: Sequence[FloorPosition]) -> None:
        mask = np.zeros(image.shape[:2], np.uint8)
        cv2.fillPoly(mask, [self._pixels(outline)], 255, cv2.LINE_AA, _SHIFT)
        tinted = cv2.addWeighted(image, 0.62, np.full_like(image, _bgr(_VIEW)), 0.38, 0.0)
        cv2.copyTo(tinted, mask, image)

    def _draw_person(self, image: Image, presence: Presence, robot: Pose2D) -> None:
        look = APPEARANCES[presence.person.look]
        here, way = (presence.x, presence.y), presence.direction(robot.x, robot.y)
        nose = (here[0] + 0.13 * cos(way), here[1] + 0.13 * sin(way))
        self._draw_disc(image, here, BODY_RADIUS, look.shirt, _INK)
        self._draw_disc(image, nose, 0.05, look.skin, None)
        self._draw_disc(image, here, 0.12, look.hair_colour if look.hair != "bald" else look.skin, None)
        self._draw_label(image, presence.person.name, (here[0], here[1] + BODY_RADIUS + 0.12), on=_FLOOR)

    def _label_object(self, image: Image, thing: WorldBox | WorldBall) -> None:
        """Write the name of an object: on it if there is room, else below it."""
        solid = thing.solid()
        half = self._text_size(thing.name)[0] / 2 / self._scale + 0.03
        if solid.nearest_offset(solid.x + half, solid.y) == solid.nearest_offset(solid.x - half, solid.y) == (0.0, 0.0):
            self._draw_label(image, thing.name, (solid.x, solid.y), on=thing.colour)
        else:
            lowest = min(y for _, y in solid.corners()) if isinstance(solid, UprightBox) else solid.y - solid.radius
            self._draw_label(image, thing.name, (solid.x, lowest - 0.12), on=_FLOOR)

    def _draw_rover(self, image: Image, rover: Rover, time: float) -> None:
        solid = rover.solid(time)
        self._draw_box(image, solid, rover.colour, _INK)
        front = (solid.x + solid.cos * solid.length / 2, solid.y + solid.sin * solid.length / 2)
        self._draw_line(image, (solid.x, solid.y), front, (255, 255, 255), 2)
        self._draw_label(image, rover.name, (solid.x, solid.y + solid.bounding_radius + 0.1), on=_FLOOR)

    def _draw_robot(self, image: Image, pose: Pose2D) -> None:
        self._draw_disc(image, (pose.x, pose.y), BASE_RADIUS, _ROBOT, (20, 50, 100))
        tip = (pose.x + BASE_RADIUS * cos(pose.heading), pose.y + BASE_RADIUS * sin(pose.heading))
        self._draw_line(image, (pose.x, pose.y), tip, (255, 255, 255), 2)

    # --- shapes, in metres --------------------------------------------------------------------------------------------

    def _pixels(self, places: Sequence[FloorPosition]) -> npt.NDArray[np.int32]:
        """Return the pixels (k, 2) of positions, in OpenCV's fixed-point format (``_SHIFT``)."""
        centre, half = np.array(self._world.room.centre), np.array(self._size) / 2
        flipped = (np.array(places) - centre) * (self._scale, -self._scale) + half
        pixels: npt.NDArray[np.int32] = np.rint(flipped * 2**_SHIFT).astype(np.int32)
        return pixels

    def _draw_box(self, image: Image, block: UprightBox, colour: Colour, rim: Colour | None) -> None:
        outline = self._pixels(block.corners())
        cv2.fillConvexPoly(image, outline, _bgr(colour), cv2.LINE_AA, _SHIFT)
        if rim is not None:
            cv2.polylines(image, [outline], True, _bgr(rim), 1, cv2.LINE_AA, _SHIFT)

    def _draw_disc(self, image: Image, place: FloorPosition, radius: float, colour: Colour, rim: Colour | None) -> None:
        x, y = self._pixels([place])[0].tolist()
        size = round(radius * self._scale * 2**_SHIFT)
        cv2.circle(image, (x, y), size, _bgr(colour), -1, cv2.LINE_AA, _SHIFT)
        if rim is not None:
            cv2.circle(image, (x, y), size, _bgr(rim), 1, cv2.LINE_AA, _SHIFT)

    def _draw_line(
        self, image: Image, start: FloorPosition, end: FloorPosition, colour: Colour, width: int = 1
    ) -> None:
        first, second = self._pixels([start, end]).tolist()
        cv2.line(image, first, second, _bgr(colour), width, cv2.LINE_AA, _SHIFT)

    def _draw_label(self, image: Image, text: str, middle: FloorPosition, *, on: Colour) -> None:
        """Write a name, in light letters on a dark background."""
        wide, high = self._text_size(text)
        x, y = (self._pixels([middle])[0] / 2**_SHIFT).tolist()
        spot = (round(x - wide / 2), round(y + high / 2))
        colour = _bgr(_INK if sum(on) > 330 else (244, 244, 240))
        cv2.putText(image, _to_ascii(text), spot, _FONT, self._font_size, colour, 1, cv2.LINE_AA)

    def _text_size(self, text: str) -> tuple[int, int]:
        """Return the width and height of a name in pixels."""
        (wide, high), _ = cv2.getTextSize(_to_ascii(text), _FONT, self._font_size, 1)
        return wide, high


def _to_ascii(text: str) -> str:
    """Return a name in ASCII, the only letters that OpenCV can draw."""
    return normalize("NFKD", text).encode("ascii", "ignore").decode()


def _bgr(colour: Colour) -> Colour:
    return colour[2], colour[1], colour[0]
