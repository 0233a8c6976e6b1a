"""Drawing of the robot's face as shapes, for web pages, pictures and videos.

A shape is a chain of cubic Bézier curves, which every renderer supports and which can be animated by numbers.
"""

import unicodedata
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import cos, sin

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Image
from drivers.api.fast_dataclass import dataclass
from drivers.screen.expression import FaceExpression, TextLayout, layout_text

Point = tuple[float, float]

CIRCLE_CONTROL = 0.5523
"""Distance of the control points of a quarter ellipse from its ends, as a share of the half-axis."""


@dataclass(frozen=True, slots=True)
class FaceShape:
    """A shape of a face: a chain of cubic curves, with colours. x points to the right, y down.

    ``points`` are the first point, then two control points and an end for each curve. ``fill`` and ``line`` are colours
    as ``#rrggbb``, empty for none; a filled shape is closed. ``width`` is that of the line, whose ends are round.
    ``opacity`` is 0..1.
    """

    points: tuple[Point, ...]
    fill: str = ""
    line: str = ""
    width: float = 0.0
    opacity: float = 1.0

    def curves(self) -> Iterator[tuple[Point, Point, Point, Point]]:
        """Yield each curve with both its ends."""
        for place in range(0, len(self.points) - 1, 3):
            start, leave, arrive, end = self.points[place : place + 4]
            yield start, leave, arrive, end

    def transform(self, *, scale: float, angle: float, centre: Point, to: Point) -> "FaceShape":
        """Return the shape scaled and rotated clockwise by ``angle`` (radians) about ``centre``, moved ``to``."""
        along, across = scale * cos(angle), scale * sin(angle)
        moved = (
            (to[0] + along * (x - centre[0]) - across * (y - centre[1]),
             to[1] + across * (x - centre[0]) + along * (y - centre[1]))
            for x, y in self.points
        )  # fmt: skip
        return replace(self, points=tuple(moved), width=self.width * scale)


def polyline(*points: Point) -> tuple[Point, ...]:
    """Return straight lines through the given points, as a chain of curves."""
    found = [points[0]]
    for (x, y), (next_x, next_y) in pairwise(points):
        found += [
            (x + (next_x - x) / 3, y + (next_y - y) / 3),
            (next_x - (next_x - x) / 3, next_y - (next_y - y) / 3),
            (next_x, next_y),
        ]
    return tuple(found)


def closed_curve(left: Point, top: Point, right: Point, bottom: Point) -> tuple[Point, ...]:
    """Return a closed chain of four curves through the given points, which is an ellipse if they are symmetric."""

    def level(end: Point, side: Point) -> Point:
        return end[0] + CIRCLE_CONTROL * (side[0] - end[0]), end[1]

    def upright(side: Point, end: Point) -> Point:
        return side[0], side[1] + CIRCLE_CONTROL * (end[1] - side[1])

    return (
        left, upright(left, top), level(top, left), top,
        level(top, right), upright(right, top), right,
        upright(right, bottom), level(bottom, right), bottom,
        level(bottom, left), upright(left, bottom), left,
    )  # fmt: skip


def oval(centre: Point, across: float, down: float) -> tuple[Point, ...]:
    """Return an ellipse with these half-axes."""
    x, y = centre
    return closed_curve((x - across, y), (x, y - down), (x + across, y), (x, y + down))


def curve_segment(
    points: tuple[Point, Point, Point, Point], begin: float, end: float
) -> tuple[Point, Point, Point, Point]:
    """Return the segment of a curve between two parameters, 0..1 (de Casteljau's construction)."""

    def blend(a: Point, b: Point, share: float) -> Point:
        return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])

    def blossom(*shares: float) -> Point:
        left: tuple[Point, ...] = points
        for share in shares:
            left = tuple(blend(a, b, share) for a, b in pairwise(left))
        return left[0]

    return (
        blossom(begin, begin, begin), blossom(begin, begin, end), blossom(begin, end, end), blossom(end, end, end)
    )  # fmt: skip


WIDTH, HEIGHT = 320.0, 240.0
"""Size of the sheet that the face is drawn on; it is scaled to the screen."""

NIGHT, CREAM, TEAL, INK, CORAL, WINE, ROSE, SKY = (
    "#101826", "#fff4dc", "#17a398", "#10202e", "#ff6b73", "#7c1f35", "#f2788a", "#7cc8ff",
)  # fmt: skip
"""Palette with a dark background: visible across a room, without lighting it at night."""

MIDDLE_X = WIDTH / 2
SIDES = (-1.0, 1.0)
EYE, EYE_Y, ACROSS, DOWN = 66.0, 104.0, 42.0, 47.0  # from the middle, from the top, half-axes
MOUTH_Y = 184.0
SCALE_ABOVE_TEXT = 0.68
"""Scale of the face above text."""


@dataclass(frozen=True, slots=True)
class FaceDrawing:
    """Shapes of a face from back to front, and the text below it.

    Every drawing has the same number of shapes and points, so that pages can animate them.
    """

    shapes: tuple[FaceShape, ...]
    text: TextLayout


def draw_face(face: FaceExpression, text: str = "") -> FaceDrawing:
    """Return the drawing of a face with text below it."""
    words = layout_text(text)
    scale = SCALE_ABOVE_TEXT if words.lines else 1.0
    middle = (MIDDLE_X, HEIGHT / 2)
    shapes = (
        shape.transform(scale=scale, angle=face.tilt, centre=middle, to=(MIDDLE_X, scale * middle[1]))
        for shape in _face(face)
    )
    return FaceDrawing(tuple(shapes), words)


def _face(face: FaceExpression) -> Iterator[FaceShape]:
    for side in SIDES:
        yield FaceShape(oval((MIDDLE_X + side * 112, 164), 22, 13), fill=CORAL, opacity=0.85 * face.cheeks)
    for side in SIDES:
        yield from _eye(face, side)
        yield _brow(face, side)
    yield from _mouth(face)
    yield _tear(face)
    yield from _waves(face)
    yield from _letters(face)


def _eye(face: FaceExpression, side: float) -> Iterator[FaceShape]:
    x, y = MIDDLE_X + side * EYE, EYE_Y
    top, bottom = y - face.upper * DOWN, y + face.lower * DOWN
    inner, outer = x - side * ACROSS, x + side * ACROSS
    corner = y + 0.5 * face.slant * DOWN
    peak = (x - side * face.slant * 0.5 * ACROSS, top)
    outline = closed_curve((inner, y), peak, (outer, corner), (x, bottom))
    yield FaceShape(outline, fill=CREAM, line=CREAM, width=12)
    room = (bottom - top) / 2 - 1
    seen = face.pupil > 0 and room > 5
    size = max(face.pupil, 0.1)
    flat = min(max(room, 0.5) / (27 * size), 1.0)
    at = (x + 12 * face.gaze, (top + bottom) / 2 + 3 * face.slant)
    for colour, radius, (aside, above) in (
        (TEAL, 27.0, (0.0, 0.0)),
        (INK, 17.0, (0.0, 0.0)),
        (CREAM, 7.5, (-8.0, -9.0)),
        (CREAM, 3.5, (8.0, 9.0)),
    ):
        centre = (at[0] + aside * size, at[1] + above * size * flat)
        yield FaceShape(oval(centre, radius * size, radius * size * flat), fill=colour, opacity=float(seen))


def _brow(face: FaceExpression, side: float) -> FaceShape:
    x, y = MIDDLE_X + side * (EYE + 4), 44 - 20 * (face.brow_height - 0.5)
    reach, angle = 30.0, side * face.brow_tilt

    def at(along: float, up: float) -> Point:
        return x + along * cos(angle) + up * sin(angle), y + along * sin(angle) - up * cos(angle)

    return FaceShape((at(-reach, 0), at(-reach / 3, 9), at(reach / 3, 9), at(reach, 0)), line=TEAL, width=10)


def _mouth(face: FaceExpression) -> Iterator[FaceShape]:
    half = 58 * face.width * (1 - 0.12 * face.opening)
    corner = MOUTH_Y - 12 * face.curve + 11 * face.opening * (1 - max(face.curve, 0.0))
    rest = MOUTH_Y + 12 * face.curve
    reach = half * (0.5 + 0.75 * face.opening)
    upper = rest - 22 * face.opening * (1 - 0.7 * max(face.curve, 0.0))
    lower = rest + 40 * face.opening

    left, right = (MIDDLE_X - half, corner), (MIDDLE_X + half, corner)
    lip = (right, (MIDDLE_X + reach, lower), (MIDDLE_X - reach, lower), left)
    outline = (left, (MIDDLE_X - reach, upper), (MIDDLE_X + reach, upper), *lip)
    begin, leave, arrive, end = curve_segment(lip, 0.25, 0.75)
    bulge = 0.45 * (lower - upper)
    tongue = (begin, leave, arrive, end, (end[0] + 4, end[1] - bulge), (begin[0] - 4, begin[1] - bulge), begin)
    yield FaceShape(outline, fill=WINE)
    yield FaceShape(tongue, fill=ROSE, opacity=min(max(4 * face.opening - 0.8, 0.0), 1.0))
    yield FaceShape(outline, line=CREAM, width=9)


def _tear(face: FaceExpression) -> FaceShape:
    x, y = MIDDLE_X + EYE + 20, 162 + 40 * face.breath
    drop = ((x, y - 16), (x + 3, y - 7), (x + 10, y - 2), (x + 10, y + 4), (x + 10, y + 15), (x - 10, y + 15),
            (x - 10, y + 4), (x - 10, y - 2), (x - 3, y - 7), (x, y - 16))  # fmt: skip
    return FaceShape(drop, fill=SKY, opacity=face.tear * _fade(face.breath))


def _waves(face: FaceExpression) -> Iterator[FaceShape]:
    """Yield arcs of sound waves that approach the face on both sides, one after the other."""
    for side in SIDES:
        for number in (0, 1):
            near = (2 * face.breath + number / 2) % 1.0
            x, tall = MIDDLE_X + side * (142 - 18 * near), 34 - 20 * near
            arc = ((x, 118 - tall), (x + side * tall / 3, 118 - tall / 3), (x + side * tall / 3, 118 + tall / 3),
                   (x, 118 + tall))  # fmt: skip
            yield FaceShape(arc, line=SKY, width=7, opacity=face.waves * _fade(near))


def _letters(face: FaceExpression) -> Iterator[FaceShape]:
    """Yield the letters Z that rise from a sleeping face, one after the other."""
    for number in (0, 1):
        risen = (face.breath + number / 2) % 1.0
        x, y, size = 270 + 30 * risen, 78 - 58 * risen, 6 + 8 * risen
        letter = polyline((x - size, y - size), (x + size, y - size), (x - size, y + size), (x + size, y + size))
        yield FaceShape(letter, line=SKY, width=6, opacity=face.sleep * _fade(risen))


def _fade(share: float) -> float:
    """Return the opacity of a shape that fades in and out while ``share`` goes from 0 to 1."""
    return min(1.0, 6 * share, 3 * (1 - share))


# The face as an image: for films and records, where there is no browser.

SUBPIXEL_BITS = 4
"""Number of fractional bits in the pixel coordinates of OpenCV's drawing functions."""

CURVE_PARAMETERS = np.linspace(0.0, 1.0, 11)
BERNSTEIN = np.stack(
    (
        (1 - CURVE_PARAMETERS) ** 3,
        3 * CURVE_PARAMETERS * (1 - CURVE_PARAMETERS) ** 2,
        3 * CURVE_PARAMETERS**2 * (1 - CURVE_PARAMETERS),
        CURVE_PARAMETERS**3,
    ),
    axis=1,
)
"""Weights of the four control points of a curve at its 11 drawn points: shape (11, 4)."""

FONT = cv2.FONT_HERSHEY_DUPLEX
CAPITAL_HEIGHT = 22.0
"""Height of a capital letter of OpenCV's font ``FONT`` at scale 1, in pixels.

In most other fonts a capital letter has 0.73 of the font size.
"""


def face_image(face: FaceExpression, text: str, size: tuple[int, int]) -> Image:
    """Return the face with ``text`` below it, (height, width, 3) BGR; ``size`` is width and height in pixels.

    Letters that OpenCV lacks lose their accents, or become question marks.
    """
    drawing = draw_face(face, text)
    scale = min(size[0] / WIDTH, size[1] / HEIGHT)
    corner = ((size[0] - scale * WIDTH) / 2, (size[1] - scale * HEIGHT) / 2)
    image: Image = np.empty((size[1], size[0], 3), np.uint8)
    cv2.rectangle(image, (0, 0), size, _colour(NIGHT), cv2.FILLED)  # much faster than numpy's fill
    for shape in drawing.shapes:
        if shape.opacity > 0:
            _paint(image, shape.transform(scale=scale, angle=0.0, centre=(0.0, 0.0), to=corner))
    _write_text(image, drawing.text, scale, corner)
    return image


def _paint(image: Image, shape: FaceShape) -> None:
    outline = np.rint((_flatten(shape) - 0.5) * (1 << SUBPIXEL_BITS)).astype(np.int32)
    if shape.fill:
        cv2.fillPoly(image, [outline], _blend_with_background(shape.fill, shape.opacity), cv2.LINE_AA, SUBPIXEL_BITS)
    if shape.line:
        width = max(1, round(shape.width - 1))  # its soft edge lies outside of it
        colour = _blend_with_background(shape.line, shape.opacity)
        cv2.polylines(image, [outline], bool(shape.fill), colour, width, cv2.LINE_AA, SUBPIXEL_BITS)


def _flatten(shape: FaceShape) -> npt.NDArray[np.float64]:
    """Return points along the curves of a shape, as an array of shape (n, 2)."""
    return np.concatenate(BERNSTEIN @ np.array(list(shape.curves())))


def _write_text(image: Image, words: TextLayout, scale: float, corner: tuple[float, float]) -> None:
    for line, foot in zip(words.lines, words.baselines, strict=True):
        plain = unicodedata.normalize("NFKD", line.replace("…", "..."))
        plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
        plain = plain.encode("ascii", "replace").decode()
        large = 0.73 * words.size * scale / CAPITAL_HEIGHT
        thick = max(1, round(0.07 * words.size * scale))
        (across, _), _ = cv2.getTextSize(plain, FONT, large, thick)
        place = round(corner[0] + scale * WIDTH / 2 - across / 2), round(corner[1] + scale * foot)
        cv2.putText(image, plain, place, FONT, large, _colour(CREAM), thick, cv2.LINE_AA)


def _colour(written: str) -> tuple[int, int, int]:
    """Return blue, green and red (0..255) of a colour ``#rrggbb``."""
    return int(written[5:7], 16), int(written[3:5], 16), int(written[1:3], 16)


def _blend_with_background(written: str, opacity: float) -> tuple[float, float, float]:
    """Return the colour ``written`` (``#rrggbb``) with this opacity over the dark background, as blue, green, red."""
    blue, green, red = (
        opacity * front + (1 - opacity) * back for front, back in zip(_colour(written), _colour(NIGHT), strict=True)
    )
    return blue, green, red
