"""Painting of heads: a face from the front, or the back of the head.

A Haar cascade looks for light and dark areas: eyes darker than forehead and cheeks, a bright bridge of the nose between
them, a dark mouth above a bright chin. So the shading matters more than the outlines. Coordinates are millimetres from
the point between the eyes; a head spans about -122 (crown) to +118 (chin).
"""

from collections.abc import Sequence
from math import ceil, floor

import cv2
import numpy as np
import numpy.typing as npt

from drivers.sim.appearances import Appearance
from drivers.sim.room import Colour

# A transparent sheet to paint soft shapes on, one pixel to the millimetre.
#
# Coordinates are millimetres from the point between the eyes of whoever is painted, x to the right, y down.

Points = Sequence[tuple[float, float]] | npt.NDArray[np.float64]
Sprite = npt.NDArray[np.uint8]
"""A painted sheet: shape (height, width, 4), dtype uint8; blue, green, red already multiplied by the opacity."""

_SHIFT = 4  # bits of sub-pixel accuracy in OpenCV's drawing functions


def oval(x: float, y: float, across: float, down: float) -> npt.NDArray[np.float64]:
    """Return the outline (48, 2) of an upright ellipse about (x, y) with these half-axes."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    return np.stack((x + across * np.cos(angle), y + down * np.sin(angle)), axis=1)


def mirror_outline(points: Points) -> npt.NDArray[np.float64]:
    """Return a symmetrical outline: ``points`` of the right side from the top, then their mirror images."""
    right = np.asarray(points, dtype=np.float64)
    return np.concatenate((right, right[::-1] * (-1.0, 1.0)))


class SpriteCanvas:
    """Transparent sheet from (left, top) to (right, bottom); later shapes cover earlier ones."""

    def __init__(self, left: int, top: int, right: int, bottom: int) -> None:
        self._left = left
        self._top = top
        self._sheet = np.zeros((bottom - top, right - left, 4), np.float32)  # 0..255, multiplied by the opacity

    def fill(self, points: Points, colour: Colour, *, soft: float = 0.6, strength: float = 1.0) -> None:
        """Paint an opaque shape; ``soft`` is the blur of its edge in millimetres."""
        area, mask = self._mask(points, soft, None)
        self._sheet[area] += mask * strength * (_opaque_pixel(colour) - self._sheet[area])

    def shade(self, points: Points, colour: Colour, *, soft: float, strength: float) -> None:
        """Tint the painted pixels inside a shape; transparent pixels stay transparent."""
        area, mask = self._mask(points, soft, None)
        self._tint(area, mask * strength, colour)

    def stroke(self, points: Points, colour: Colour, width: float, *, soft: float = 0.6, strength: float = 1.0) -> None:
        """Draw a line through ``points`` on painted pixels; ``width`` in millimetres."""
        area, mask = self._mask(points, soft, width)
        self._tint(area, mask * strength, colour)

    def sprite(self) -> Sprite:
        """Return the sheet with colours premultiplied by opacity."""
        return np.clip(np.rint(self._sheet), 0, 255).astype(np.uint8)

    def _tint(self, area: tuple[slice, slice], mask: npt.NDArray[np.float32], colour: Colour) -> None:
        opacity = self._sheet[area][..., 3:] / 255.0
        self._sheet[area] += mask * (opacity * _opaque_pixel(colour) - self._sheet[area])

    def _mask(
        self, points: Points, soft: float, width: float | None
    ) -> tuple[tuple[slice, slice], npt.NDArray[np.float32]]:
        """Return the area of the sheet that a shape covers, and its coverage per pixel (0..1, shape (h, w, 1))."""
        outline = np.asarray(points, dtype=np.float64) - (self._left, self._top)
        reach = 3.0 * soft + (width or 0.0) + 2.0
        height, breadth = self._sheet.shape[:2]
        low, high = outline.min(axis=0) - reach, outline.max(axis=0) + reach
        x0, y0 = max(0, floor(low[0])), max(0, floor(low[1]))
        x1, y1 = max(x0 + 1, min(breadth, ceil(high[0]))), max(y0 + 1, min(height, ceil(high[1])))
        mask = np.zeros((y1 - y0, x1 - x0), np.uint8)
        fixed = np.rint((outline - (x0, y0)) * 2**_SHIFT).astype(np.int32)
        if width is None:
            cv2.fillPoly(mask, [fixed], 255, cv2.LINE_AA, _SHIFT)
        else:
            cv2.polylines(mask, [fixed], False, 255, max(1, round(width)), cv2.LINE_AA, _SHIFT)
        blurred = cv2.GaussianBlur(mask.astype(np.float32) / 255.0, (0, 0), soft)
        return (slice(y0, y1), slice(x0, x1)), np.asarray(blurred, np.float32)[..., None]


def _opaque_pixel(colour: Colour) -> npt.NDArray[np.float32]:
    """Return a colour as an opaque pixel: blue, green, red, opacity."""
    return np.array((*colour[::-1], 255), np.float32)


_DARK = (24, 16, 14)
_WHITE = (236, 232, 226)
_CIRCLE_ANGLES = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)  # round an outline
_LINE_POSITIONS = np.linspace(-1.0, 1.0, 17)  # along a line, from its left to its right end


def mix_colours(a: Colour, b: Colour, share: float) -> Colour:
    """Return a mix of two colours with a ``share`` of ``b``."""
    red, green, blue = (round(p + share * (q - p)) for p, q in zip(a, b, strict=True))
    return red, green, blue


def paint_head(canvas: SpriteCanvas, look: Appearance) -> None:
    """Paint a head from the front."""
    _skin(canvas, look)
    for side in (-1.0, 1.0):
        _eye(canvas, look, side)
    _nose(canvas, look)
    _mouth(canvas, look)
    if look.beard:
        _beard(canvas, look)
    _hair_in_front(canvas, look)
    if look.glasses:
        _glasses(canvas, look)


def paint_back_of_head(canvas: SpriteCanvas, look: Appearance) -> None:
    """Paint a head from behind, in which no face can be detected."""
    half = look.face_width / 2
    scalp = look.skin if look.hair == "bald" else look.hair_colour
    if look.hair != "long":
        for side in (-1.0, 1.0):
            canvas.fill(oval(side * (half + 2), 12, 9, 26), mix_colours(look.skin, _DARK, 0.15))
        canvas.fill(oval(0, 60, half * 0.78, 50), mix_colours(look.skin, _DARK, 0.12), soft=2)
    else:
        canvas.fill(oval(0, 60, half + 14, 110), scalp, soft=4)
    canvas.fill(oval(0, -12, half + 3, 110), scalp, soft=1)
    canvas.shade(oval(-half, -10, half * 0.6, 90), _DARK, soft=22, strength=0.3)
    canvas.shade(oval(half, -10, half * 0.6, 90), _DARK, soft=22, strength=0.3)


def _face_outline(look: Appearance) -> Points:
    """Return the outline of the face: a skull above the eyes, a jaw below."""
    half, jaw = look.face_width / 2, look.jaw
    skull = [(half * np.sin(a), -16 - 98 * np.cos(a)) for a in np.linspace(0.02, np.pi / 2, 16)]
    cheek = [(half * 0.99, 22), (half * 0.93, 52), (half * 0.80 * jaw, 80), (half * 0.58 * jaw, 102)]
    return mirror_outline([*skull, *cheek, (half * 0.32 * jaw, 115), (0, 119)])


def _skin(canvas: SpriteCanvas, look: Appearance) -> None:
    half, shadow = look.face_width / 2, mix_colours(look.skin, _DARK, 0.75)
    for side in (-1.0, 1.0):
        canvas.fill(oval(side * (half + 3), 14, 10, 28), mix_colours(look.skin, (150, 60, 50), 0.18))
    canvas.fill(_face_outline(look), look.skin, soft=1.0)
    for side in (-1.0, 1.0):  # the sides turn away from the light
        canvas.shade(oval(side * half * 1.08, 10, half * 0.34, 110), shadow, soft=13, strength=0.42)
        canvas.shade(
            oval(side * half * 0.55, 34, 20, 15), mix_colours(look.skin, (255, 250, 244), 0.5), soft=9, strength=0.5
        )
        canvas.shade(oval(side * half * 0.52, 36, 18, 14), (206, 92, 84), soft=9, strength=0.10)
    canvas.shade(oval(0, -62, half * 0.62, 24), mix_colours(look.skin, (255, 252, 248), 0.6), soft=14, strength=0.55)
    canvas.shade(oval(0, 122, half * 0.7, 10), shadow, soft=7, strength=0.45)


def _eye(canvas: SpriteCanvas, look: Appearance, side: float) -> None:
    x, shadow = side * look.eye_distance / 2, mix_colours(look.skin, _DARK, 0.85)
    canvas.shade(oval(x * 1.02, -6, 25, 13), shadow, soft=6, strength=0.52)  # the socket
    canvas.shade(oval(x * 0.80, -3, 10, 10), shadow, soft=5, strength=0.30)  # its inner corner, beside the nose
    canvas.shade(oval(x, 13, 17, 3), shadow, soft=3, strength=0.22)
    almond = [(x + 15.5 * np.cos(a), 1.5 - 6.5 * np.sin(a) * (1.0 if np.sin(a) > 0 else 0.72)) for a in _CIRCLE_ANGLES]
    canvas.fill(almond, mix_colours(_WHITE, look.skin, 0.25), soft=0.8)
    canvas.fill(oval(x, 0.5, 6.6, 6.4), look.eyes, soft=0.7)
    canvas.fill(oval(x, 0.5, 3.2, 3.2), (10, 8, 8), soft=0.5)
    canvas.fill(oval(x - 1.8, -1.6, 1.0, 1.0), _WHITE, soft=0.5)
    canvas.stroke([(x + u, -0.5 - 6.0 * (1 - (u / 16.5) ** 2)) for u in _LINE_POSITIONS * 16.5], _DARK, 3, soft=0.8)
    canvas.stroke([(x + u, 1.5 + 5.0 * (1 - (u / 15.5) ** 2)) for u in _LINE_POSITIONS * 15.5], shadow, 1, strength=0.6)
    brow = [(x * 1.05 + side * u, -19.0 - 4.0 * (1 - ((u - 4) / 22) ** 2)) for u in _LINE_POSITIONS * 20]
    canvas.stroke(brow, mix_colours(look.hair_colour, _DARK, 0.45), look.brow, soft=1.2, strength=0.85)


def _nose(canvas: SpriteCanvas, look: Appearance) -> None:
    light, shadow = mix_colours(look.skin, (255, 250, 246), 0.55), mix_colours(look.skin, _DARK, 0.8)
    canvas.shade(oval(0, 8, 6.5, 40), light, soft=3.5, strength=0.65)
    canvas.shade(oval(0, 40, 9, 7), light, soft=4, strength=0.5)
    for side in (-1.0, 1.0):
        canvas.shade(oval(side * 13, 26, 4, 20), shadow, soft=4, strength=0.26)
        canvas.shade(oval(side * 17, 44, 4, 8), shadow, soft=2.5, strength=0.35)
        canvas.shade(oval(side * 8, 51.5, 4.6, 2.6), _DARK, soft=1.3, strength=0.75)
    canvas.shade(oval(0, 55, 17, 4), shadow, soft=3, strength=0.5)


def _mouth(canvas: SpriteCanvas, look: Appearance) -> None:
    half, lip = look.mouth_width / 2, mix_colours(look.skin, (150, 48, 52), 0.55)
    upper = mirror_outline([(0, 70), (half * 0.22, 68.5), (half * 0.6, 71), (half, 75), (half * 0.5, 77), (0, 77.5)])
    lower = mirror_outline([(0, 76.5), (half * 0.6, 76.5), (half, 75), (half * 0.62, 84), (half * 0.25, 87.5), (0, 88)])
    canvas.fill(upper, mix_colours(lip, _DARK, 0.22), soft=1.0)
    canvas.fill(lower, mix_colours(lip, (255, 220, 214), 0.15), soft=1.2)
    line = [(u, 77.4 - 2.0 * (u / half) ** 2) for u in _LINE_POSITIONS * (half + 2)]
    canvas.stroke(line, _DARK, 3, soft=1.0, strength=0.85)
    canvas.shade(oval(0, 93, half * 0.75, 4), mix_colours(look.skin, _DARK, 0.8), soft=3.5, strength=0.45)
    canvas.shade(oval(0, 104, 15, 7), mix_colours(look.skin, (255, 250, 246), 0.5), soft=5, strength=0.4)


def _beard(canvas: SpriteCanvas, look: Appearance) -> None:
    half, colour = look.face_width / 2, mix_colours(look.hair_colour, look.skin, 0.12)
    jaw = mirror_outline(
        [(0, 94), (half * 0.42, 92), (half * 0.62, 66), (half * 0.88, 40), (half, 30), (half * 0.96, 62),
         (half * 0.84 * look.jaw, 92), (half * 0.6 * look.jaw, 114), (half * 0.3, 126), (0, 128)]
    )  # fmt: skip
    canvas.fill(jaw, colour, soft=4, strength=0.88)
    canvas.shade(mirror_outline([(0, 60), (20, 62), (30, 74), (34, 92), (28, 92), (22, 72), (0, 67)]), colour, soft=2.5,
                 strength=0.75)  # fmt: skip


def paint_hair_behind(canvas: SpriteCanvas, look: Appearance) -> None:
    """Paint the hair behind neck and face; call this before painting both."""
    half, dark = look.face_width / 2, mix_colours(look.hair_colour, _DARK, 0.3)
    if look.hair == "long":
        canvas.fill(mirror_outline([(0, -126), (half * 0.7, -116), (half + 16, -50), (half + 22, 60), (half + 24, 160),
                              (half * 0.75, 190), (0, 180)]), dark, soft=2)  # fmt: skip
    elif look.hair == "curly":
        for angle in np.linspace(-0.15, np.pi + 0.15, 17):
            canvas.fill(oval((half + 12) * np.cos(angle), -22 - 92 * np.sin(angle), 24, 24), dark, soft=1.5)
    elif look.hair == "bun":
        canvas.fill(oval(0, -128, 36, 26), look.hair_colour, soft=1.5)
        canvas.fill(oval(0, -30, half + 8, 96), dark, soft=1.5)
    elif look.hair == "short":
        canvas.fill(oval(0, -36, half + 7, 86), dark, soft=1.5)


def _hair_in_front(canvas: SpriteCanvas, look: Appearance) -> None:
    half, colour = look.face_width / 2, look.hair_colour
    shine = mix_colours(colour, (255, 240, 224), 0.25)
    if look.hair == "bald":
        canvas.shade(oval(0, -92, half * 0.5, 14), mix_colours(look.skin, (255, 252, 250), 0.6), soft=9, strength=0.5)
        return
    line = {"short": -66.0, "long": -72.0, "curly": -64.0, "bun": -74.0}[look.hair]
    crown = [(0, -124), (half * 0.55, -117), (half * 0.92, -88), (half + 6, -44)]
    side = [(half + 5, 8 if look.hair == "long" else -12), (half * 0.93, -30), (half * 0.78, line + 16)]
    canvas.fill(mirror_outline([*crown, *side, (half * 0.4, line), (0, line - 4)]), colour, soft=2)
    canvas.shade(oval(-half * 0.2, -102, half * 0.5, 8), shine, soft=6, strength=0.7)
    if look.hair == "long":
        for way in (-1.0, 1.0):
            lock = [(-6, -60), (14, -30), (20, 90), (14, 170), (-8, 168), (1, 40)]
            canvas.fill([(way * (half + x), y) for x, y in lock], colour, soft=2.5)
    elif look.hair == "curly":
        for x in np.linspace(-half * 0.85, half * 0.85, 8):
            canvas.fill(oval(x, -84 + 0.004 * x * x, 15, 15), mix_colours(colour, shine, 0.2 + 0.2 * (x > 0)), soft=2.5)


def _glasses(canvas: SpriteCanvas, look: Appearance) -> None:
    x, rim = look.eye_distance / 2 + 1, (62, 50, 46)
    for side in (-1.0, 1.0):
        frame = oval(side * x, 3, 25, 20)
        canvas.stroke([*frame, frame[0]], rim, 2, soft=0.8, strength=0.7)
        canvas.stroke([(side * (x + 25), -2), (side * look.face_width / 2, -6)], rim, 2, soft=0.8, strength=0.7)
    canvas.stroke([(-8, 0), (0, -3), (8, 0)], rim, 3, soft=0.8, strength=0.85)
