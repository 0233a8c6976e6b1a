"""What stands in the room, ready to be painted: boxes, balls, robots with markers, people."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, hypot, sin, sqrt
from typing import Protocol

import cv2
import numpy as np

from drivers.sim.billboard import halved, hang
from drivers.sim.block import Block, Disc
from drivers.sim.canvas import Sprite
from drivers.sim.figure import CROWN, HALF_WIDTH, MILLIMETRE
from drivers.sim.painter import NEAR_PLANE, Painter
from drivers.sim.panels import shaded
from drivers.sim.people import Presence
from drivers.sim.room import Colour
from drivers.sim.things import MARKER_SIZE, Ball, Box, Rover, Wall

Detail = tuple[float, float, float, float, float]
"""A rectangle on each side of a box, from left, to right, from low, to high as shares of the side; and its shade."""

_SKIRTING: Detail = (0.0, 1.0, 0.0, 0.035, 0.62)
_DOORS: tuple[Detail, ...] = ((0.05, 0.48, 0.08, 0.94, 0.92), (0.52, 0.95, 0.08, 0.94, 0.92))
_SUN = 2.2  # radians about z: where the light comes from
_CELLS = 8  # across a marker, its white rim included
_TEXELS = 12  # pixels to a cell of a marker
_BALL = 128  # pixels across the sheet of a ball


class Drawable(Protocol):
    """Something that stands in the room."""

    @property
    def solid(self) -> Block | Disc:
        """The room that it takes, for the order of painting."""
        ...

    def paint(self, painter: Painter) -> None:
        """Draw it."""
        ...


class PaintedBlock:
    """An upright box of one colour, its sides in different light, with ``details`` on each."""

    def __init__(self, block: Block, colour: Colour, details: Sequence[Detail] = ()) -> None:
        self.solid = block
        sides = list(_sides(block, colour, details))
        self._corners = np.array([corners for corners, _, _ in sides])
        self._normals = np.array([normal for _, normal, _ in sides])
        self._colours = [shade for _, _, shade in sides]

    def paint(self, painter: Painter) -> None:
        """Draw the sides that are turned to the camera."""
        turned = ((painter.eye - self._corners[:, 0]) * self._normals).sum(axis=1) > 0
        shown = np.flatnonzero(turned)
        painter.fill(self._corners[shown], [self._colours[index] for index in shown])


class PaintedRover:
    """Another robot: a box, and a marker on each of its four sides, which ``marker_sheets`` paints."""

    def __init__(self, rover: Rover, time: float, sheets: Sequence[Sprite]) -> None:
        self.solid = rover.solid(time)
        self._colour = rover.colour
        self._sheets = sheets

    def paint(self, painter: Painter) -> None:
        """Draw the box, then the markers on the sides that are turned to the camera."""
        PaintedBlock(self.solid, self._colour).paint(painter)
        side = MARKER_SIZE * _CELLS / 6
        height = max(self.solid.top / 2, self.solid.top - side / 2 - 0.03)
        texel = side / (_CELLS * _TEXELS)
        for x, y, nx, ny in _side_middles(self.solid):
            if (painter.eye[0] - x) * nx + (painter.eye[1] - y) * ny <= 0:
                continue
            right = np.array((-ny, nx, 0.0))
            corner = np.array((x, y, height + side / 2)) - right * side / 2
            hang(painter, self._sheets, corner, right * texel, np.array((0.0, 0.0, -texel)))


class PaintedBall:
    """A ball, lit from above."""

    def __init__(self, ball: Ball) -> None:
        self.solid = ball.solid()
        self._radius = ball.size / 2
        self._sheets = halved(_shaded_disc(ball.colour))

    def paint(self, painter: Painter) -> None:
        """Draw the disc that is seen of a ball: its outline is a circle square to the line of sight."""
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
        texel = 2 * self._radius / sqrt(1 - (self._radius / away) ** 2) / _BALL
        hang(painter, self._sheets, middle - (across + down) * texel * _BALL / 2, across * texel, down * texel)


@dataclass(frozen=True, slots=True, eq=False)
class PaintedPerson:
    """Somebody as a flat figure that always turns to the camera; ``sheets`` show them from before or from behind."""

    presence: Presence
    sheets: tuple[Sprite, ...]

    @property
    def solid(self) -> Disc:
        """The room that the figure takes."""
        return self.presence.body()

    def paint(self, painter: Painter) -> None:
        """Draw the figure; one whose eyes are lower than usual, who nods, is that much shorter."""
        who = self.presence
        ax, ay = who.x - painter.view.x, who.y - painter.view.y
        away = hypot(ax, ay)
        if away < NEAR_PLANE:
            return
        across = np.array((ay, -ax, 0.0)) / away
        stretch = who.eyes / who.person.height
        corner = np.array((who.x, who.y, who.eyes + CROWN * MILLIMETRE * stretch))
        corner -= across * (HALF_WIDTH * MILLIMETRE)
        hang(painter, self.sheets, corner, across * MILLIMETRE, np.array((0.0, 0.0, -MILLIMETRE * stretch)))


def painted_things(
    walls: Iterable[Wall], furniture: Iterable[Box], objects: Iterable[Box | Ball], wall_colour: Colour
) -> list[Drawable]:
    """Return what never moves."""
    found: list[Drawable] = [PaintedBlock(wall.solid(), wall_colour, (_SKIRTING,)) for wall in walls]
    found += [PaintedBlock(box.solid(), box.colour, _DOORS) for box in furniture]
    found += [PaintedBall(it) if isinstance(it, Ball) else PaintedBlock(it.solid(), it.colour) for it in objects]
    return found


def marker_sheets(number: int) -> tuple[Sprite, ...]:
    """Return marker ``number`` of ArUco's DICT_4X4_50 on white, opaque, in sizes as ``halved`` makes them."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    bits = np.full((_CELLS, _CELLS), 235, np.uint8)
    bits[1:-1, 1:-1] = np.clip(cv2.aruco.generateImageMarker(dictionary, number, 6), 16, 235)
    grey = np.kron(bits, np.ones((_TEXELS, _TEXELS), np.uint8))
    return halved(np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGRA), np.uint8))


def _sides(
    block: Block, colour: Colour, details: Sequence[Detail]
) -> Iterator[tuple[list[tuple[float, float, float]], tuple[float, float, float], Colour]]:
    """Yield corners, outward normal and colour of each side of a box, and of what is on it."""
    low, high = block.bottom, block.top
    corners = block.corners()
    yield [(x, y, high) for x, y in corners], (0.0, 0.0, 1.0), shaded(colour, 1.06)
    yield [(x, y, low) for x, y in reversed(corners)], (0.0, 0.0, -1.0), shaded(colour, 0.5)
    for number, (x0, y0) in enumerate(corners):
        x1, y1 = corners[(number + 1) % 4]
        length = hypot(x1 - x0, y1 - y0)
        normal = ((y1 - y0) / length, (x0 - x1) / length, 0.0)
        light = 0.86 + 0.12 * (normal[0] * cos(_SUN) + normal[1] * sin(_SUN))
        for left, right, lower, upper, shade in ((0.0, 1.0, 0.0, 1.0, 1.0), *details):
            (ax, ay), (bx, by) = ((x0 + share * (x1 - x0), y0 + share * (y1 - y0)) for share in (left, right))
            za, zb = low + lower * (high - low), low + upper * (high - low)
            yield [(ax, ay, za), (bx, by, za), (bx, by, zb), (ax, ay, zb)], normal, shaded(colour, light * shade)


def _side_middles(block: Block) -> Iterator[tuple[float, float, float, float]]:
    """Yield the middle (x, y) of each side of a box, and its outward normal (x, y)."""
    for u, v in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        nx, ny = u * block.cos - v * block.sin, u * block.sin + v * block.cos
        half = block.length / 2 if u else block.width / 2
        yield block.x + nx * half, block.y + ny * half, nx, ny


def _shaded_disc(colour: Colour) -> Sprite:
    """Paint a ball that is lit from above on the left: of one hue, as a seeker of colours expects."""
    half = (_BALL - 1) / 2
    x, y = np.meshgrid(np.arange(_BALL) - half, np.arange(_BALL) - half)
    x, y = x / (half + 0.5), y / (half + 0.5)
    z = np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))
    light = np.clip(0.45 + 0.6 * np.clip(-0.35 * x - 0.5 * y + 0.79 * z, 0, 1), 0, 1.05)
    opacity = np.clip((1 - np.hypot(x, y)) * half, 0, 1)
    paint = np.clip(light[..., None] * np.array(colour[::-1]), 0, 255)
    sheet = np.dstack((paint, np.full_like(light, 255.0))) * opacity[..., None]
    painted: Sprite = np.rint(sheet).astype(np.uint8)
    return painted
