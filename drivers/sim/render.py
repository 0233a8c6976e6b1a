"""Draws the simulated world as a camera would see it."""

from math import atan2, cos, radians

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Image
from drivers.sim.billboard import NEAR, Figure, stand
from drivers.sim.figure import paint_figure
from drivers.sim.looks import LOOKS
from drivers.sim.panels import panels
from drivers.sim.people import Person, Presence
from drivers.sim.viewpoint import Floats, Pinhole, Viewpoint
from drivers.sim.world import World

_WALL_MARGIN = 0.05  # metres that the lens stays away from walls, floor and ceiling
_SPREAD = 64  # pixels by which the sheet of noise is larger than a picture, so that it can be shifted
_SHIFT = 4  # bits of sub-pixel accuracy in OpenCV's drawing functions
_FACE_SHOWS = cos(radians(60.0))  # of the angle by which somebody is turned away from the camera


class Renderer:
    """Draws pictures of one world through one lens.

    ``noise`` is the standard deviation of the Gaussian noise in grey levels (0..255), drawn from ``seed``. People are
    painted when first seen and kept. Not safe between threads.
    """

    def __init__(self, world: World, lens: Pinhole, *, noise: float = 3.0, seed: int = 0) -> None:
        self._world = world
        self._lens = lens
        self._noise = noise
        self._random = np.random.default_rng(seed)
        self._grain: npt.NDArray[np.uint8] | None = None
        self._figures: dict[tuple[str, float, bool], Figure] = {}
        parts = panels(world.room)
        self._corners = np.stack([part.corners for part in parts])  # (n, 4, 3), metres
        self._colours = [part.colour[::-1] for part in parts]

    def draw(self, view: Viewpoint, time: float) -> Image:
        """Return the world at ``time`` seconds from ``view``, which is kept inside the room."""
        view = self._inside(view)
        image: Image = np.full((self._lens.height, self._lens.width, 3), 128, np.uint8)
        self._draw_room(image, view)
        people = self._world.people_at(time)
        for presence in sorted(people, key=lambda who: -who.distance(view.x, view.y)):
            figure = self._figure(presence.person, from_behind=not _shows_face(presence, view))
            stand(image, figure, (presence.x, presence.y), presence.person.height, view, self._lens)
        return self._exposed(image)

    def _inside(self, view: Viewpoint) -> Viewpoint:
        (x0, x1), (y0, y1) = self._world.room.extent()
        low = np.array((x0, y0, 0.0)) + _WALL_MARGIN
        high = np.array((x1, y1, self._world.room.height)) - _WALL_MARGIN
        x, y, z = np.clip(view.place(), low, high)
        return Viewpoint(float(x), float(y), float(z), view.yaw, view.pitch)

    def _draw_room(self, image: Image, view: Viewpoint) -> None:
        seen = (self._corners - view.place()) @ view.rotation().T  # camera coordinates, (n, 4, 3)
        for corners, colour in zip(seen, self._colours, strict=True):
            if corners[:, 2].max() <= NEAR:
                continue
            points = self._projected(corners if corners[:, 2].min() > NEAR else _clipped(corners))
            low, high = points.min(axis=0), points.max(axis=0)
            if low[0] < self._lens.width and low[1] < self._lens.height and high[0] >= 0 and high[1] >= 0:
                fixed = np.rint(points * 2**_SHIFT).astype(np.int32)
                cv2.fillConvexPoly(image, fixed, colour, cv2.LINE_AA, _SHIFT)

    def _projected(self, corners: Floats) -> Floats:
        """Return the pixels (k, 2) of points (k, 3) in camera coordinates."""
        lens = self._lens
        middle = ((lens.width - 1) / 2, (lens.height - 1) / 2)
        pixels: Floats = corners[:, :2] * (lens.focal / corners[:, 2:]) + middle
        return pixels

    def _figure(self, person: Person, *, from_behind: bool) -> Figure:
        key = (person.look, person.height, from_behind)
        if key not in self._figures:
            self._figures[key] = Figure.of(paint_figure(LOOKS[person.look], person.height, from_behind=from_behind))
        return self._figures[key]

    def _exposed(self, image: Image) -> Image:
        """Scale by the light and add noise, in one pass: the noise lies about 128, which is taken off again."""
        if self._grain is None:
            shape = (self._lens.height + _SPREAD, self._lens.width + _SPREAD, 3)
            noise = self._random.standard_normal(shape, np.float32) * np.float32(self._noise)
            self._grain = np.clip(np.rint(noise + 128.0), 0, 255).astype(np.uint8)
        x, y = (int(value) for value in self._random.integers(0, _SPREAD, 2))
        grain = self._grain[y : y + self._lens.height, x : x + self._lens.width]
        return np.asarray(cv2.addWeighted(image, self._world.light, grain, 1.0, -128.0), np.uint8)


def _clipped(corners: Floats) -> Floats:
    """Cut off what of a polygon (k, 3) lies nearer than ``NEAR`` (Sutherland and Hodgman, for this one plane)."""
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[2] > NEAR:
            kept.append(a)
        if (a[2] > NEAR) != (b[2] > NEAR):
            kept.append(a + (NEAR - a[2]) / (b[2] - a[2]) * (b - a))
    return np.array(kept)


def _shows_face(presence: Presence, view: Viewpoint) -> bool:
    """Say whether somebody is turned towards the camera by less than 60 degrees off."""
    facing = presence.person.facing
    if facing == "camera":
        return True
    return cos(facing - atan2(view.y - presence.y, view.x - presence.x)) >= _FACE_SHOWS
