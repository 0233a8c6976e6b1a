"""Detection of balls and boxes of given colours (ranges in HSV) in one picture, and the sense for coloured things."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isnan, pi, sqrt
from typing import cast

import cv2
import numpy as np
import numpy.typing as npt

from perception.api import ANY, BALL, BOX, Box, Frame, Gaze, Image, Thing, ThingSpec
from perception.geometry import Pinhole
from perception.tracks import BOX_WIDENING, MIN_SPOT_PIXELS, SEARCH_WIDTH, ColourSpot, ThingSighting, Tracker

# Which of a few named colours each spot of a picture has, in whatever light it was taken.

# Which shape a spot of one colour has, judged by its outline.

Contour = npt.NDArray[np.int32]
"""Outline of a spot of one colour: shape (points, 1, 2), dtype int32, x and y in pixels."""

MIN_SOLIDITY = 0.88
"""Smallest share of its convex hull that the spot of a ball or box fills; spots with a dent fill less."""

MIN_ROUNDNESS = 0.81
"""Smallest share of the enclosing circle that a ball fills.

A square fills 0.64 of it, a disc all of it, or 0.85 at a width of ten pixels. A cube seen from far above fills 0.83 and
may be taken for a ball.
"""

MIN_SQUARENESS = 0.79
"""Smallest share of the enclosing rectangle that a box fills.

A disc fills 0.785, but is tested for first.
"""

MAX_ELONGATION = 4.0
"""Largest ratio of length to width of a ball's or box's spot."""


@dataclass(frozen=True, slots=True)
class SpotOutline:
    """Outline of a spot: the upright ``box`` around it, its ``shape``, and its ``width`` in pixels.

    The width is the diameter of a ball; for a box, that of its front as far as it can be measured.
    """

    box: Box
    shape: str
    width: float


def judge_outline(contour: Contour) -> SpotOutline | None:
    """Return the shape of a spot; None if it is neither a ball nor a box.

    A contour runs through the middles of the outermost pixels, so half a pixel is added on each side.
    """
    x, y, across, down = cv2.boundingRect(contour)
    hull = np.asarray(cv2.convexHull(contour), np.int32)
    area, hull_area = _filled_pixels(contour), _filled_pixels(hull)
    _, radius = cv2.minEnclosingCircle(hull)
    (_, _), (one, other), _ = cv2.minAreaRect(hull)
    short, long = sorted((one + 1.0, other + 1.0))
    if area < MIN_SOLIDITY * hull_area or long > MAX_ELONGATION * short:
        return None
    box = Box(float(x), float(y), float(across), float(down))
    if area >= MIN_ROUNDNESS * pi * (radius + 0.5) ** 2:
        return SpotOutline(box, BALL, 2 * sqrt(area / pi))
    if area >= MIN_SQUARENESS * short * long:
        return SpotOutline(box, BOX, across / BOX_WIDENING)
    return None


def _filled_pixels(contour: Contour) -> float:
    """Return the number of pixels on and inside an outline, by Pick's theorem."""
    return cv2.contourArea(contour) + cv2.arcLength(contour, closed=True) / 2 + 1


Colour = tuple[int, int, int]
"""Red, green and blue, each 0..255."""

DiscPlaces = npt.NDArray[np.float32]
"""Positions (x, y) in the disc of hues and saturations; shape (..., 2), dtype float32."""

Labels = npt.NDArray[np.uint8]
"""Colour number of each pixel; shape (height, width), dtype uint8."""

MAX_COLOUR_DISTANCE = 0.35
"""Largest distance of a pixel from a colour, in the disc of hues and saturations (radius 1), to count as that colour.
"""

MAX_PALE_SATURATION = 0.55
"""Saturation above which a pixel is coloured in any light, and does not help to estimate the colour of the light.

A white wall in candle light has 0.5.
"""

MIN_PALE_SHARE = 0.05
"""Smallest share of pale pixels in a picture from which the colour of the light is estimated."""

GAIN_LIMITS = (0.6, 1.7)
"""Limits of a channel's gain in white balance.

A picture that needs more is taken to show a scene of one colour, not a coloured light.
"""

MIN_CHROMA = 9
"""Smallest difference (0..255) between a pixel's strongest and weakest channel at which its hue is not just noise."""


def balance_white(picture: Image) -> Image:
    """Return the picture as in white light.

    The colour of the light is estimated as the Minkowski mean of power 6 ("shades of grey", after Finlayson and Trezzi,
    "Shades of gray and colour constancy", CIC 2004), between the mean and the brightest spots. Pixels that are too
    colourful to be grey in usual light are ignored; otherwise a large red box would make the light red.
    """
    some = np.stack([picture[::4, ::4, channel].ravel() for channel in range(3)]).astype(np.float32) / np.float32(255)
    high = np.maximum(np.maximum(some[0], some[1]), some[2])
    low = np.minimum(np.minimum(some[0], some[1]), some[2])
    pale = high - low <= MAX_PALE_SATURATION * high
    if pale.mean() > MIN_PALE_SHARE:  # else all is colourful
        some = some[:, pale]
    means = np.maximum(np.mean((some * some * some) ** 2, axis=1) ** (1 / 6), 0.01)
    gains = np.clip(means.mean() / means, *GAIN_LIMITS)
    levels = np.clip(np.rint(np.arange(256)[:, None] * gains), 0, 255)  # what each becomes, in each channel
    return cast(Image, cv2.LUT(picture, levels.astype(np.uint8)[None]))


class Palette:
    """Classifies pixels by the colours of ``names``, or as having no hue.

    Hue and saturation are compared as positions in a disc, which do not change when the light fades. The nearest colour
    wins, so colours that are not targets (brown wood, grey walls) are not confused with them.
    """

    def __init__(self, colours: Mapping[str, Colour]) -> None:
        self.names: Sequence[str] = tuple(colours)
        swatches = np.array([[colour[::-1] for colour in colours.values()]], np.uint8)
        self.places: DiscPlaces = to_colour_disc(swatches)[0]
        self._table = _nearest_colour_table(self.places)

    def label(self, picture: Image) -> Labels:
        """Return the number of each pixel's colour in ``names``; ``len(names)`` for none of them."""
        hue, saturation, value = cv2.split(cv2.cvtColor(picture, cv2.COLOR_BGR2HSV))
        place = np.asarray(cv2.merge((saturation, hue))).view("<u2")[..., 0]  # hue << 8 | saturation
        labels: Labels = self._table.take(place)
        chroma = np.asarray(cv2.multiply(saturation, value, scale=1 / 255))
        np.copyto(labels, len(self.names), where=chroma < MIN_CHROMA)
        return labels


def to_colour_disc(picture: Image) -> DiscPlaces:
    """Return the positions of a picture's colours in the disc of hues and saturations, whose radius is 1.

    The hue is the angle: red 0, green a third of a turn. The brightness of a colour is ignored.
    """
    hue, saturation, _ = cv2.split(cv2.cvtColor(picture, cv2.COLOR_BGR2HSV))
    angle = np.asarray(hue, np.float32) * np.float32(pi / 90)  # OpenCV counts in steps of 2 degrees
    away = np.asarray(saturation, np.float32) / np.float32(255)
    return np.dstack((away * np.cos(angle), away * np.sin(angle)))


def _nearest_colour_table(places: DiscPlaces) -> Labels:
    """Return the number of the nearest colour in ``places`` for each hue and saturation, as a flat lookup table.

    The index of an entry is hue * 256 + saturation, with the hue in steps of 2 degrees and the saturation of 0..255.
    """
    hue, saturation = np.meshgrid(np.arange(180) * (pi / 90), np.arange(256) / 255, indexing="ij")
    x, y = saturation * np.cos(hue), saturation * np.sin(hue)
    off = [*(np.hypot(x - at_x, y - at_y) for at_x, at_y in places), np.full(x.shape, MAX_COLOUR_DISTANCE)]
    nearest: Labels = np.argmin(off, axis=0).astype(np.uint8).ravel()
    return nearest


MAX_SPOT_SHARE = 0.5
"""Share of the picture above which a spot of one colour is taken for a wall, not for a thing."""

MAX_MEAN_DISTANCE = 0.22
"""Largest distance of a thing's mean colour from the wanted colour, in the disc of hues and saturations (radius 1)."""

MIN_SURROUND_DISTANCE = 0.2
"""Smallest distance from the wanted colour at which the surroundings of a thing count as differently coloured.

The distance is in the disc of hues and saturations (radius 1).
"""

MAX_LEAK_SHARE = 0.3
"""Largest share of a thing's surroundings that has the colour of the thing.

With a larger share, the spot is part of something larger.
"""

SURROUND_PIXELS = 3
"""Width of the surroundings of a thing, in pixels."""

_SURROUND_BRUSH = np.ones((2 * SURROUND_PIXELS + 1, 2 * SURROUND_PIXELS + 1), np.uint8)
_BRUSH = np.ones((3, 3), np.uint8)


class SpotFinder:
    """Finds balls and boxes of the colours in ``targets``.

    ``colours`` has the targets and all colours that may be confused with them, as red, green and blue in full light.
    Raises ValueError for a target that is not in ``colours``.
    """

    def __init__(self, colours: Mapping[str, Colour], targets: Sequence[str]) -> None:
        self._palette = Palette(colours)
        unknown = sorted(set(targets) - set(colours))
        if unknown:
            raise ValueError(f"things: no such colour: {', '.join(unknown)}; known are: {', '.join(colours)}")
        self._targets = [(name, self._palette.names.index(name)) for name in dict.fromkeys(targets)]

    def find(self, image: Image) -> list[ColourSpot]:
        """Return the balls and boxes in a picture of shape (height, width, 3), largest first."""
        scale = max(1.0, image.shape[1] / SEARCH_WIDTH)
        picture = balance_white(_smooth(image, scale))
        labels = self._palette.label(picture)
        found = [
            ColourSpot(_scale_box(seen.box, scale), name, seen.shape, seen.width * scale)
            for name, number in self._targets
            for contour in _find_contours(labels, number)
            if self._is_distinct(picture, contour, number)
            if (seen := judge_outline(contour)) is not None
        ]
        return sorted(found, key=lambda spot: -spot.box.width * spot.box.height)

    def _is_distinct(self, picture: Image, contour: Contour, number: int) -> bool:
        """Return whether a spot has colour ``number`` as a whole, and its surroundings mostly do not.

        ``contour`` is the outline of the spot.
        """
        inside, around = _inside_and_around(picture, contour)
        mean = inside.mean(axis=0)
        if np.linalg.norm(mean - self._palette.places[number]) > MAX_MEAN_DISTANCE:
            return False
        alike = np.linalg.norm(around - mean, axis=1) < MIN_SURROUND_DISTANCE
        return bool(alike.mean() <= MAX_LEAK_SHARE)


def _smooth(image: Image, scale: float) -> Image:
    """Return the picture shrunk by the factor ``scale``, with less noise."""
    if scale > 1.0:
        size = round(image.shape[1] / scale), max(1, round(image.shape[0] / scale))
        image = cast(Image, cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    return cast(Image, cv2.GaussianBlur(image, (3, 3), 0))


def _find_contours(labels: Labels, number: int) -> Iterator[Contour]:
    """Yield the contours of all spots with colour ``number`` that may be balls or boxes.

    Spots that touch the edge of the picture are left out, since a part of them is not visible.
    """
    mask = np.equal(labels, number).view(np.uint8)
    mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, _BRUSH), np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    height, width = labels.shape
    for contour in contours:
        x, y, across, down = cv2.boundingRect(contour)
        cut = x <= 0 or y <= 0 or x + across >= width or y + down >= height
        if not cut and min(across, down) >= MIN_SPOT_PIXELS and across * down <= MAX_SPOT_SHARE * width * height:
            yield np.asarray(contour, np.int32)


def _inside_and_around(picture: Image, contour: Contour) -> tuple[DiscPlaces, DiscPlaces]:
    """Return the colours (in the disc, of shape (pixels, 2)) inside a contour, and in a band around it.

    The band starts a little away from the contour, where colours mix.
    """
    x, y, across, down = cv2.boundingRect(contour)
    x, y = max(0, x - SURROUND_PIXELS), max(0, y - SURROUND_PIXELS)
    part = picture[y : y + down + 2 * SURROUND_PIXELS, x : x + across + 2 * SURROUND_PIXELS]
    inside = np.zeros(part.shape[:2], np.uint8)
    cv2.drawContours(inside, [contour], 0, 1, cv2.FILLED, offset=(-x, -y))
    around = cv2.dilate(inside, _SURROUND_BRUSH) - cv2.dilate(inside, _BRUSH)
    places = to_colour_disc(part)
    return places[inside > 0], places[around > 0]


def _scale_box(box: Box, scale: float) -> Box:
    return Box(box.x * scale, box.y * scale, box.width * scale, box.height * scale)


# The sense for coloured shapes: a red ball, a blue box, looked for by name and followed over time.

MIN_DISTANCE, MAX_DISTANCE = 0.1, 8.0
"""Metres: a spot that would have to be nearer or farther away for its size is something else."""


class ThingSense:
    """Detects coloured things by colour and shape and tracks them by name: a ``perception.senses.Sense[Thing]``.

    ``colours`` are all named colours, as red, green and blue; they include those of ``specs``.
    """

    def __init__(self, specs: Sequence[ThingSpec], colours: Mapping[str, Colour]) -> None:
        self._specs = tuple(dict.fromkeys(specs))
        self._finder = SpotFinder(colours, [one.colour for one in self._specs])
        self._tracker = Tracker[Thing]()

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Thing, ...]:
        spots = self._finder.find(frame.image) if self._specs else ()
        sightings = [sighting for spot in spots for sighting in self._matching_sightings(spot, camera)]
        return self._tracker.update(sightings, camera=camera, gaze=gaze, stamp=frame.stamp)

    def _matching_sightings(self, spot: ColourSpot, camera: Pinhole) -> Iterator[ThingSighting]:
        """Yield a sighting for each specification that the spot matches."""
        for wanted in self._specs:
            if wanted.colour == spot.colour and wanted.shape in (ANY, spot.shape):
                sighting = ThingSighting(spot, wanted)
                away = sighting.distance(camera)
                if isnan(away) or MIN_DISTANCE <= away <= MAX_DISTANCE:
                    yield sighting
