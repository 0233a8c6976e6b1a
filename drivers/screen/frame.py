"""The face as an image: for films and records, where there is no browser."""

import unicodedata

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Image
from drivers.screen.drawing import CREAM, HEIGHT, NIGHT, WIDTH, Shape, draw
from drivers.screen.expression import Expression
from drivers.screen.words import Words

SHIFT = 4
"""Bits of sub-pixel accuracy in OpenCV's drawing functions."""

STEPS = np.linspace(0.0, 1.0, 11)
BERNSTEIN = np.stack(((1 - STEPS) ** 3, 3 * STEPS * (1 - STEPS) ** 2, 3 * STEPS**2 * (1 - STEPS), STEPS**3), axis=1)
"""What each control point of a curve counts at the points that it is drawn through, (11, 4)."""

LETTERS = cv2.FONT_HERSHEY_DUPLEX
CAPITAL = 22.0
"""Pixels that a capital of these letters is high at scale 1; of most others it is 0.73 of their size."""


def frame(face: Expression, text: str, size: tuple[int, int]) -> Image:
    """Return the face with ``text`` below it, (height, width, 3) BGR; ``size`` is width and height in pixels.

    Letters that OpenCV does not have lose their accents, or become question marks.
    """
    drawing = draw(face, text)
    scale = min(size[0] / WIDTH, size[1] / HEIGHT)
    corner = ((size[0] - scale * WIDTH) / 2, (size[1] - scale * HEIGHT) / 2)
    image: Image = np.empty((size[1], size[0], 3), np.uint8)
    cv2.rectangle(image, (0, 0), size, _colour(NIGHT), cv2.FILLED)  # many times as fast as numpy's fill
    for shape in drawing.shapes:
        if shape.opacity > 0:
            _paint(image, shape.placed(scale=scale, angle=0.0, centre=(0.0, 0.0), to=corner))
    _write(image, drawing.words, scale, corner)
    return image


def _paint(image: Image, shape: Shape) -> None:
    outline = np.rint((_flat(shape) - 0.5) * (1 << SHIFT)).astype(np.int32)
    if shape.fill:
        cv2.fillPoly(image, [outline], _mixed(shape.fill, shape.opacity), cv2.LINE_AA, SHIFT)
    if shape.line:
        width = max(1, round(shape.width - 1))  # its soft edge lies outside of it
        colour = _mixed(shape.line, shape.opacity)
        cv2.polylines(image, [outline], bool(shape.fill), colour, width, cv2.LINE_AA, SHIFT)


def _flat(shape: Shape) -> npt.NDArray[np.float64]:
    """Return points (n, 2) along the chain."""
    return np.concatenate(BERNSTEIN @ np.array(list(shape.curves())))


def _write(image: Image, words: Words, scale: float, corner: tuple[float, float]) -> None:
    for line, foot in zip(words.lines, words.feet, strict=True):
        plain = unicodedata.normalize("NFKD", line.replace("…", "..."))
        plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
        plain = plain.encode("ascii", "replace").decode()
        large = 0.73 * words.size * scale / CAPITAL
        thick = max(1, round(0.07 * words.size * scale))
        (across, _), _ = cv2.getTextSize(plain, LETTERS, large, thick)
        place = round(corner[0] + scale * WIDTH / 2 - across / 2), round(corner[1] + scale * foot)
        cv2.putText(image, plain, place, LETTERS, large, _colour(CREAM), thick, cv2.LINE_AA)


def _colour(written: str) -> tuple[int, int, int]:
    """Return blue, green, red of ``#rrggbb``."""
    return int(written[5:7], 16), int(written[3:5], 16), int(written[1:3], 16)


def _mixed(written: str, opacity: float) -> tuple[float, float, float]:
    """Return a colour over the night: what fades in and out has nothing else behind it."""
    blue, green, red = (
        opacity * front + (1 - opacity) * back for front, back in zip(_colour(written), _colour(NIGHT), strict=True)
    )
    return blue, green, red
