"""Rendering of the simulated world as a camera sees it."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import cos, hypot, sin, sqrt
from typing import Protocol, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Image
from drivers.sim.appearances import APPEARANCES, Appearance
from drivers.sim.face import (
    Points,
    Sprite,
    SpriteCanvas,
    mirror_outline,
    mix_colours,
    oval,
    paint_back_of_head,
    paint_hair_behind,
    paint_head,
)
from drivers.sim.painter import NEAR_PLANE, Floats, Painter, hole_panels, room_panels, shade_colour
from drivers.sim.people import Presence
from drivers.sim.room import Colour
from drivers.sim.solids import Point3, UprightBox, UprightCylinder
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import MARKER_SIZE, Rover, Wall, WorldBall, WorldBox

# Hangs flat painted sheets in a picture, in true perspective: people, balls, markers.

_MIN_SHEET_SIZE = 16  # pixels of the shorter side of a sheet


def make_mipmaps(sheet: Sprite) -> tuple[Sprite, ...]:
    """Return a sheet and copies of it, each half as wide and half as high as the one before.

    A large sheet would flicker if it were sampled sparsely for a small image.
    """
    sizes = [sheet]
    while min(sizes[-1].shape[:2]) >= 2 * _MIN_SHEET_SIZE:
        sizes.append(np.asarray(cv2.pyrDown(sizes[-1]), np.uint8))
    return tuple(sizes)


def draw_sheet(painter: Painter, sizes: Sequence[Sprite], corner: Floats, across: Floats, down: Floats) -> None:
    """Draw a flat sheet that hangs in the world.

    ``sizes`` are copies of the sheet from ``make_mipmaps``, the largest first. ``corner`` is the position of the
    sheet's top left corner in metres; ``across`` and ``down`` are vectors along its edges, as long as one pixel of the
    largest copy.
    """
    middle = corner + across * (sizes[0].shape[1] / 2) + down * (sizes[0].shape[0] / 2)
    away = max(NEAR_PLANE, float(np.linalg.norm(middle - painter.eye)))
    finest = painter.lens.focal * float(np.linalg.norm(across))  # metres from which a pixel of it is one of the picture
    level = int(np.clip(np.log2(away / finest), 0, len(sizes) - 1))
    sheet, step = sizes[level], 2**level
    # Camera coordinates of the sheet's pixel (u, v) are plane @ (u, v, 1).
    plane = painter.rotation @ np.stack((across * step, down * step, corner - painter.eye), axis=1)
    rows = _rows_in_front(plane, sheet.shape[1], sheet.shape[0])
    if rows is not None:
        _blend_sheet(
            painter, sheet[rows], np.array(painter.lens.matrix()) @ plane @ _translation(0.0, float(rows.start))
        )


def _rows_in_front(plane: Floats, width: int, height: int) -> slice | None:
    """Return the rows of a sheet that are beyond ``NEAR_PLANE``, or None. Depth is linear along the sheet."""
    v = np.arange(height)
    depth = plane[2, 2] + plane[2, 1] * v + min(0.0, plane[2, 0] * width)
    seen = np.flatnonzero(depth > NEAR_PLANE)
    return slice(int(seen[0]), int(seen[-1]) + 1) if seen.size > 1 else None


def _blend_sheet(painter: Painter, sheet: Sprite, mapping: Floats) -> None:
    """Blend a sheet into the picture by a homography (3, 3) from its pixels to those of the picture."""
    high, wide = sheet.shape[:2]
    corners = mapping @ np.array(((0, wide, wide, 0), (0, 0, high, high), (1, 1, 1, 1)))
    points = corners[:2] / corners[2]
    low = np.maximum(np.floor(points.min(axis=1)).astype(int), 0)
    top = np.minimum(np.ceil(points.max(axis=1)).astype(int) + 1, (painter.lens.width, painter.lens.height))
    if np.any(top <= low):
        return
    size = (int(top[0] - low[0]), int(top[1] - low[1]))
    part = painter.image[low[1] : top[1], low[0] : top[0]]
    drawn = cv2.warpPerspective(sheet, _translation(-float(low[0]), -float(low[1])) @ mapping, size)
    through = cv2.cvtColor(cv2.bitwise_not(cv2.extractChannel(drawn, 3)), cv2.COLOR_GRAY2BGR)
    part[:] = cv2.add(cv2.cvtColor(drawn, cv2.COLOR_BGRA2BGR), cv2.multiply(part, through, scale=1 / 255))


def _translation(x: float, y: float) -> Floats:
    """Return the homography (3, 3) of a shift by (x, y)."""
    return np.array(((1.0, 0.0, x), (0.0, 1.0, y), (0.0, 0.0, 1.0)))


# The order in which solid things are painted: what may be hidden comes before what may hide it.

_OVERLAP_TOLERANCE = 0.01
"""Metres by which two objects may overlap and still count as separate, such as a ball that lies on a table."""


class SolidObject(Protocol):
    """Object of the world with a solid shape."""

    @property
    def solid(self) -> UprightBox | UprightCylinder:
        """Shape of the object."""
        ...


S = TypeVar("S", bound=SolidObject)


def sort_back_to_front(things: Sequence[S], eye: Point3) -> list[S]:
    """Return ``things`` in the order of painting, as seen from ``eye``.

    If a plane separates two objects, the one on the side of the eye cannot be hidden by the other. Objects that
    overlap, and cycles, have no such order; of those the farther one comes first.
    """
    far = sorted(things, key=lambda thing: -_squared_distance(thing.solid, eye))
    done: list[S] = []
    waiting = dict(enumerate(far))

    def paint(number: int) -> None:
        thing = waiting.pop(number)
        for other in list(waiting):
            if other in waiting and _is_behind(waiting[other].solid, thing.solid, eye):
                paint(other)
        done.append(thing)

    while waiting:
        paint(next(iter(waiting)))
    return done


def _is_behind(one: UprightBox | UprightCylinder, other: UprightBox | UprightCylinder, eye: Point3) -> bool:
    """Return whether a plane separates the two objects, with the eye on the side of ``other``."""
    if one.top <= other.bottom + _OVERLAP_TOLERANCE:
        return eye[2] > other.bottom
    if other.top <= one.bottom + _OVERLAP_TOLERANCE:
        return eye[2] < one.bottom
    if isinstance(one, UprightBox):
        beyond = _is_separated_by(one, other, eye)
        if beyond is not None:
            return beyond
    if isinstance(other, UprightBox):
        beyond = _is_separated_by(other, one, eye)
        if beyond is not None:
            return not beyond
    return False


def _is_separated_by(block: UprightBox, other: UprightBox | UprightCylinder, eye: Point3) -> bool | None:
    """Return whether the side of ``block`` that has ``other`` in front of it has the eye in front of it, too.

    None if no side of ``block`` separates it from ``other``.
    """
    if isinstance(other, UprightCylinder):
        u, v = block.to_local(other.x, other.y)
        spans = ((u - other.radius, u + other.radius), (v - other.radius, v + other.radius))
    else:
        us, vs = zip(*(block.to_local(*corner) for corner in other.corners()), strict=True)
        spans = ((min(us), max(us)), (min(vs), max(vs)))
    halves = (block.length / 2, block.width / 2)
    for place, (low, high), half in zip(block.to_local(eye[0], eye[1]), spans, halves, strict=True):
        if low >= half - _OVERLAP_TOLERANCE:
            return place > half
        if high <= _OVERLAP_TOLERANCE - half:
            return place < -half
    return None


def _squared_distance(solid: UprightBox | UprightCylinder, eye: Point3) -> float:
    return (solid.x - eye[0]) ** 2 + (solid.y - eye[1]) ** 2


# Paints whole people, as flat figures that are stood in the world like cardboard cut-outs.

METRES_PER_PIXEL = 0.001
"""Metres per pixel of the painted figure of a person."""

FIGURE_HALF_WIDTH = 340
"""Half the width of a figure in millimetres, with room for shoulders and arms."""

FIGURE_CROWN = 170
"""Millimetres from the eyes to the top of a figure, with room for hair."""

_DARK = (20, 16, 18)


def paint_figure(look: Appearance, height: float, *, from_behind: bool = False) -> Sprite:
    """Paint a person whose eyes are ``height`` metres above the floor.

    One pixel of the sheet is a millimetre. Its lower edge is the floor; the point between the eyes is ``FIGURE_CROWN``
    pixels below its upper edge, in the middle.
    """
    floor = round(height / METRES_PER_PIXEL)
    canvas = SpriteCanvas(-FIGURE_HALF_WIDTH, -FIGURE_CROWN, FIGURE_HALF_WIDTH, floor)
    _legs(canvas, look, floor)
    _arms(canvas, look, floor)
    paint_hair_behind(canvas, look)
    _neck(canvas, look)
    _torso(canvas, look, floor)
    if from_behind:
        paint_back_of_head(canvas, look)
    else:
        paint_head(canvas, look)
    return canvas.sprite()


def _neck(canvas: SpriteCanvas, look: Appearance) -> None:
    canvas.fill(
        mirror_outline([(0, 80), (54, 80), (56, 150), (92, 196), (0, 220)]), mix_colours(look.skin, _DARK, 0.14), soft=2
    )
    canvas.shade(oval(0, 124, 62, 26), _DARK, soft=11, strength=0.42)


def _torso(canvas: SpriteCanvas, look: Appearance, floor: int) -> None:
    hip = 0.48 * floor
    body: Points = mirror_outline(
        [(0, 206), (62, 182), (110, 178), (196, 214), (214, 280), (180, 380), (164, hip - 110), (172, hip + 40)]
    )
    canvas.fill(body, look.shirt, soft=2)
    for side in (-1.0, 1.0):
        canvas.shade(oval(side * 200, hip * 0.6, 46, hip * 0.5), _DARK, soft=26, strength=0.35)
        canvas.shade(oval(side * 70, 330, 62, 70), mix_colours(look.shirt, (255, 255, 255), 0.3), soft=40, strength=0.3)
    canvas.shade(oval(0, hip + 20, 190, 60), _DARK, soft=30, strength=0.25)


def _arms(canvas: SpriteCanvas, look: Appearance, floor: int) -> None:
    wrist = 0.53 * floor
    sleeve = mix_colours(look.shirt, _DARK, 0.14)
    for side in (-1.0, 1.0):
        arm = [(side * x, y) for x, y in [(150, 206), (206, 220), (234, 300), (262, wrist), (210, wrist), (172, 320)]]
        canvas.fill(oval(side * 240, wrist + 48, 27, 60), look.skin, soft=2)
        canvas.fill(arm, sleeve, soft=3)
        canvas.shade([(side * 214, 260), (side * 250, wrist), (side * 240, wrist)], _DARK, soft=10, strength=0.3)


def _legs(canvas: SpriteCanvas, look: Appearance, floor: int) -> None:
    hip, shade = 0.46 * floor, mix_colours(look.trousers, _DARK, 0.35)
    for side in (-1.0, 1.0):
        leg = [(side * x, y) for x, y in [(0, hip), (166, hip), (158, floor - 60), (62, floor - 60), (8, hip + 130)]]
        canvas.fill(leg, look.trousers, soft=2)
        canvas.shade([(side * 150, hip), (side * 166, hip), (side * 158, floor - 60)], shade, soft=14, strength=0.8)
        canvas.fill(oval(side * 116, floor - 34, 58, 32), mix_colours(_DARK, look.trousers, 0.2), soft=2)


# What stands in the room, ready to be painted: boxes, balls, robots with markers, people.

Detail = tuple[float, float, float, float, float]
"""A rectangle that is painted on each side of a box.

Its left, right, lower and upper edge are shares (0..1) of the side; the last number is its shade.
"""

_SKIRTING: Detail = (0.0, 1.0, 0.0, 0.035, 0.62)
_DOORS: tuple[Detail, ...] = ((0.05, 0.48, 0.08, 0.94, 0.92), (0.52, 0.95, 0.08, 0.94, 0.92))
_LIGHT_DIRECTION = 2.2  # radians about z: where the light comes from
_MARKER_CELLS = 8  # across a marker, its white rim included
_PIXELS_PER_CELL = 12  # pixels to a cell of a marker
_BALL_SHEET_SIZE = 128  # pixels across the sheet of a ball


class Drawable(Protocol):
    """An object of the room that can be painted."""

    @property
    def solid(self) -> UprightBox | UprightCylinder:
        """Solid shape of the object, for the order of painting."""
        ...

    def paint(self, painter: Painter) -> None:
        """Draw the object into the picture."""
        ...


class PaintedBox:
    """An upright box of one colour, with differently lit sides and ``details`` on each."""

    def __init__(self, block: UprightBox, colour: Colour, details: Sequence[Detail] = ()) -> None:
        self.solid = block
        sides = list(_box_sides(block, colour, details))
        self._corners = np.array([corners for corners, _, _ in sides])
        self._normals = np.array([normal for _, normal, _ in sides])
        self._colours = [shade for _, _, shade in sides]

    def paint(self, painter: Painter) -> None:
        """Draw the sides that face the camera."""
        turned = ((painter.eye - self._corners[:, 0]) * self._normals).sum(axis=1) > 0
        shown = np.flatnonzero(turned)
        painter.fill(self._corners[shown], [self._colours[index] for index in shown])


class PaintedRover:
    """Another robot: a box with a marker on each of its four sides; ``sheets`` come from ``marker_sheets``."""

    def __init__(self, rover: Rover, time: float, sheets: Sequence[Sprite]) -> None:
        self.solid = rover.solid(time)
        self._colour = rover.colour
        self._sheets = sheets

    def paint(self, painter: Painter) -> None:
        """Draw the box, then the markers on the sides that face the camera."""
        PaintedBox(self.solid, self._colour).paint(painter)
        side = MARKER_SIZE * _MARKER_CELLS / 6
        height = max(self.solid.top / 2, self.solid.top - side / 2 - 0.03)
        texel = side / (_MARKER_CELLS * _PIXELS_PER_CELL)
        for x, y, nx, ny in _side_middles(self.solid):
            if (painter.eye[0] - x) * nx + (painter.eye[1] - y) * ny <= 0:
                continue
            right = np.array((-ny, nx, 0.0))
            corner = np.array((x, y, height + side / 2)) - right * side / 2
            draw_sheet(painter, self._sheets, corner, right * texel, np.array((0.0, 0.0, -texel)))


class PaintedBall:
    """A ball, lit from above."""

    def __init__(self, ball: WorldBall) -> None:
        self.solid = ball.solid()
        self._radius = ball.size / 2
        self._sheets = make_mipmaps(_paint_ball(ball.colour))

    def paint(self, painter: Painter) -> None:
        """Draw the visible disc of the ball: its outline is a circle perpendicular to the line of sight."""
        middle = np.array((self.solid.x, self.solid.y, self.solid.bottom + self._radius))
        sight = middle - painter.eye
        away = float(np.linalg.norm(sight))
        if away < self._radius + NEAR_PLANE:
            return
        across = np.cross(sight, (0.0, 0.0, 1.0))
        if not across.any():  # straight above or below
            across = np.array((0.0, -1.0, 0.0))
        across /= np.linalg.norm(across)
        down = np.cross(sight / away, across)
        texel = 2 * self._radius / sqrt(1 - (self._radius / away) ** 2) / _BALL_SHEET_SIZE
        draw_sheet(
            painter, self._sheets, middle - (across + down) * texel * _BALL_SHEET_SIZE / 2, across * texel, down * texel
        )


@dataclass(frozen=True, slots=True, eq=False)
class PaintedPerson:
    """A person as a flat figure that always faces the camera; ``sheets`` show the front or the back."""

    presence: Presence
    sheets: tuple[Sprite, ...]

    @property
    def solid(self) -> UprightCylinder:
        return self.presence.body_solid()

    def paint(self, painter: Painter) -> None:
        """Draw the figure, shortened while the eyes are lower than usual, as in a nod."""
        who = self.presence
        ax, ay = who.x - painter.view.x, who.y - painter.view.y
        away = hypot(ax, ay)
        if away < NEAR_PLANE:
            return
        across = np.array((ay, -ax, 0.0)) / away
        stretch = who.eye_height / who.person.height
        corner = np.array((who.x, who.y, who.eye_height + FIGURE_CROWN * METRES_PER_PIXEL * stretch))
        corner -= across * (FIGURE_HALF_WIDTH * METRES_PER_PIXEL)
        draw_sheet(
            painter, self.sheets, corner, across * METRES_PER_PIXEL, np.array((0.0, 0.0, -METRES_PER_PIXEL * stretch))
        )


def static_drawables(
    walls: Iterable[Wall], furniture: Iterable[WorldBox], objects: Iterable[WorldBox | WorldBall], wall_colour: Colour
) -> list[Drawable]:
    """Return the drawables of all objects that never move."""
    found: list[Drawable] = [PaintedBox(wall.solid(), wall_colour, (_SKIRTING,)) for wall in walls]
    found += [PaintedBox(box.solid(), box.colour, _DOORS) for box in furniture]
    found += [PaintedBall(it) if isinstance(it, WorldBall) else PaintedBox(it.solid(), it.colour) for it in objects]
    return found


def marker_sheets(number: int) -> tuple[Sprite, ...]:
    """Return marker ``number`` of ArUco's DICT_4X4_50 on white, opaque, as mipmaps."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    bits = np.full((_MARKER_CELLS, _MARKER_CELLS), 235, np.uint8)
    bits[1:-1, 1:-1] = np.clip(cv2.aruco.generateImageMarker(dictionary, number, 6), 16, 235)
    grey = np.kron(bits, np.ones((_PIXELS_PER_CELL, _PIXELS_PER_CELL), np.uint8))
    return make_mipmaps(np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGRA), np.uint8))


def _box_sides(
    block: UprightBox, colour: Colour, details: Sequence[Detail]
) -> Iterator[tuple[list[tuple[float, float, float]], tuple[float, float, float], Colour]]:
    """Yield corners, outward normal and colour of each side of a box, and of its details."""
    low, high = block.bottom, block.top
    corners = block.corners()
    yield [(x, y, high) for x, y in corners], (0.0, 0.0, 1.0), shade_colour(colour, 1.06)
    yield [(x, y, low) for x, y in reversed(corners)], (0.0, 0.0, -1.0), shade_colour(colour, 0.5)
    for number, (x0, y0) in enumerate(corners):
        x1, y1 = corners[(number + 1) % 4]
        length = hypot(x1 - x0, y1 - y0)
        normal = ((y1 - y0) / length, (x0 - x1) / length, 0.0)
        light = 0.86 + 0.12 * (normal[0] * cos(_LIGHT_DIRECTION) + normal[1] * sin(_LIGHT_DIRECTION))
        for left, right, lower, upper, shade in ((0.0, 1.0, 0.0, 1.0, 1.0), *details):
            (ax, ay), (bx, by) = ((x0 + share * (x1 - x0), y0 + share * (y1 - y0)) for share in (left, right))
            za, zb = low + lower * (high - low), low + upper * (high - low)
            yield [(ax, ay, za), (bx, by, za), (bx, by, zb), (ax, ay, zb)], normal, shade_colour(colour, light * shade)


def _side_middles(block: UprightBox) -> Iterator[tuple[float, float, float, float]]:
    """Yield the middle (x, y) of each side of a box, and its outward normal (x, y)."""
    for u, v in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        nx, ny = u * block.cos - v * block.sin, u * block.sin + v * block.cos
        half = block.length / 2 if u else block.width / 2
        yield block.x + nx * half, block.y + ny * half, nx, ny


def _paint_ball(colour: Colour) -> Sprite:
    """Paint a ball that is lit from the upper left, in one hue, as colour detection expects."""
    half = (_BALL_SHEET_SIZE - 1) / 2
    x, y = np.meshgrid(np.arange(_BALL_SHEET_SIZE) - half, np.arange(_BALL_SHEET_SIZE) - half)
    x, y = x / (half + 0.5), y / (half + 0.5)
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    light = np.clip(0.45 + 0.6 * np.clip(-0.35 * x - 0.5 * y + 0.79 * z, 0, 1), 0, 1.05)
    opacity = np.clip((1 - np.hypot(x, y)) * half, 0, 1)
    paint = np.clip(light[..., None] * np.array(colour[::-1]), 0, 255)
    sheet = np.dstack((paint, np.full_like(light, 255.0))) * opacity[..., None]
    painted: Sprite = np.rint(sheet).astype(np.uint8)
    return painted


_WALL_MARGIN = 0.05  # metres that the lens stays away from walls, floor and ceiling
_GRAIN_MARGIN = 64  # pixels by which the sheet of noise is larger than a picture, so that it can be shifted


class Renderer:
    """Renders pictures of one world through one lens.

    ``noise`` is the standard deviation of Gaussian noise in grey levels (0..255), generated from ``seed``. The empty
    room is cached until the camera moves, the whole picture until anything moves. Not thread-safe.
    """

    def __init__(self, world: SimulatedWorld, lens: PinholeLens, *, noise: float = 3.0, seed: int = 0) -> None:
        self._world = world
        self._lens = lens
        self._noise = noise
        self._random = np.random.default_rng(seed)
        self._grain: npt.NDArray[np.uint8] | None = None
        parts = (*room_panels(world.room), *hole_panels(world.edges))
        self._corners = np.stack([part.corners for part in parts])  # (n, 4, 3), metres
        self._colours = [part.colour for part in parts]
        self._things = static_drawables(world.walls, world.furniture, world.things, world.room.wall)
        self._robots = [(rover, marker_sheets(rover.marker)) for rover in world.robots]
        self._room: tuple[Viewpoint, Image] | None = None
        self._picture: tuple[object, Image] | None = None

    def draw(self, view: Viewpoint, time: float) -> Image:
        """Return the picture of the world at ``time`` seconds from ``view``, which is clamped to the room."""
        view = self._clamp_to_room(view)
        people = self._world.people_at(time)
        robots = tuple(PaintedRover(rover, time, sheets) for rover, sheets in self._robots)
        scene = (view, people, tuple(robot.solid for robot in robots))
        if self._picture is None or self._picture[0] != scene:
            self._picture = (
                scene,
                self._draw_evenly_lit(view, [*robots, *(self._paint_person(who, view) for who in people)]),
            )
        return self._expose(self._picture[1], self._world.light_at(time))

    def _draw_evenly_lit(self, view: Viewpoint, moving: Sequence[Drawable]) -> Image:
        """Return the picture in even light, without noise."""
        if self._room is None or self._room[0] != view:
            empty: Image = np.full((self._lens.height, self._lens.width, 3), 128, np.uint8)
            Painter(empty, view, self._lens).fill(self._corners, self._colours)
            self._room = (view, empty)
        painter = Painter(self._room[1].copy(), view, self._lens)
        shown = [thing for thing in (*self._things, *moving) if not painter.is_outside(thing.solid)]
        for thing in sort_back_to_front(shown, (view.x, view.y, view.z)):
            thing.paint(painter)
        return painter.image

    def _clamp_to_room(self, view: Viewpoint) -> Viewpoint:
        (x0, x1), (y0, y1) = self._world.room.extent()
        low = np.array((x0, y0, 0.0)) + _WALL_MARGIN
        high = np.array((x1, y1, self._world.room.height)) - _WALL_MARGIN
        x, y, z = np.clip(view.position(), low, high)
        return Viewpoint(float(x), float(y), float(z), view.yaw, view.pitch)

    def _paint_person(self, presence: Presence, view: Viewpoint) -> PaintedPerson:
        person, from_behind = presence.person, not presence.shows_face(view.x, view.y)
        return PaintedPerson(presence, _figure_mipmaps(person.look, person.height, from_behind))

    def _expose(self, image: Image, light: float) -> Image:
        """Scale the picture by the brightness ``light`` and add noise, in one pass.

        The noise is stored as bytes, with 128 added to each value.
        """
        if self._grain is None:
            shape = (self._lens.height + _GRAIN_MARGIN, self._lens.width + _GRAIN_MARGIN, 3)
            noise = self._random.standard_normal(shape, np.float32) * np.float32(self._noise)
            self._grain = np.clip(np.rint(noise + 128.0), 0, 255).astype(np.uint8)
        x, y = (int(value) for value in self._random.integers(0, _GRAIN_MARGIN, 2))
        grain = self._grain[y : y + self._lens.height, x : x + self._lens.width]
        return np.asarray(cv2.addWeighted(image, light, grain, 1.0, -128.0), np.uint8)


@lru_cache(maxsize=12)
def _figure_mipmaps(look: str, height: float, from_behind: bool) -> tuple[Sprite, ...]:
    """Return the mipmaps of a person, cached in this process: painting a person takes as long as 50 pictures."""
    figure = paint_figure(APPEARANCES[look], height, from_behind=from_behind)
    figure.setflags(write=False)
    return make_mipmaps(figure)
