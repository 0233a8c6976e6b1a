"""Draws the simulated world as a camera would see it."""

from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from drivers.api import Image
from drivers.sim.billboard import halved
from drivers.sim.canvas import Sprite
from drivers.sim.depth import back_to_front
from drivers.sim.drawable import Drawable, PaintedPerson, PaintedRover, marker_sheets, painted_things
from drivers.sim.figure import paint_figure
from drivers.sim.looks import LOOKS
from drivers.sim.painter import Painter
from drivers.sim.panels import holes, panels
from drivers.sim.people import Presence
from drivers.sim.viewpoint import Pinhole, Viewpoint
from drivers.sim.world import World

_WALL_MARGIN = 0.05  # metres that the lens stays away from walls, floor and ceiling
_SPREAD = 64  # pixels by which the sheet of noise is larger than a picture, so that it can be shifted


class Renderer:
    """Draws pictures of one world through one lens.

    ``noise`` is the standard deviation of the Gaussian noise in grey levels (0..255), drawn from ``seed``. The room is
    kept until the camera moves, and the whole picture until anything does. Not safe between threads.
    """

    def __init__(self, world: World, lens: Pinhole, *, noise: float = 3.0, seed: int = 0) -> None:
        self._world = world
        self._lens = lens
        self._noise = noise
        self._random = np.random.default_rng(seed)
        self._grain: npt.NDArray[np.uint8] | None = None
        parts = (*panels(world.room), *holes(world.edges))
        self._corners = np.stack([part.corners for part in parts])  # (n, 4, 3), metres
        self._colours = [part.colour for part in parts]
        self._things = painted_things(world.walls, world.furniture, world.things, world.room.wall)
        self._robots = [(rover, marker_sheets(rover.marker)) for rover in world.robots]
        self._room: tuple[Viewpoint, Image] | None = None
        self._picture: tuple[object, Image] | None = None

    def draw(self, view: Viewpoint, time: float) -> Image:
        """Return the world at ``time`` seconds from ``view``, which is kept inside the room."""
        view = self._inside(view)
        people = self._world.people_at(time)
        robots = tuple(PaintedRover(rover, time, sheets) for rover, sheets in self._robots)
        scene = (view, people, tuple(robot.solid for robot in robots))
        if self._picture is None or self._picture[0] != scene:
            self._picture = (scene, self._drawn(view, [*robots, *(self._painted(who, view) for who in people)]))
        return self._exposed(self._picture[1], self._world.light_at(time))

    def _drawn(self, view: Viewpoint, moving: Sequence[Drawable]) -> Image:
        """Return what is seen in even light, without noise."""
        if self._room is None or self._room[0] != view:
            empty: Image = np.full((self._lens.height, self._lens.width, 3), 128, np.uint8)
            Painter(empty, view, self._lens).fill(self._corners, self._colours)
            self._room = (view, empty)
        painter = Painter(self._room[1].copy(), view, self._lens)
        shown = [thing for thing in (*self._things, *moving) if not painter.is_outside(thing.solid)]
        for thing in back_to_front(shown, (view.x, view.y, view.z)):
            thing.paint(painter)
        return painter.image

    def _inside(self, view: Viewpoint) -> Viewpoint:
        (x0, x1), (y0, y1) = self._world.room.extent()
        low = np.array((x0, y0, 0.0)) + _WALL_MARGIN
        high = np.array((x1, y1, self._world.room.height)) - _WALL_MARGIN
        x, y, z = np.clip(view.place(), low, high)
        return Viewpoint(float(x), float(y), float(z), view.yaw, view.pitch)

    def _painted(self, presence: Presence, view: Viewpoint) -> PaintedPerson:
        person, from_behind = presence.person, not presence.shows_face(view.x, view.y)
        return PaintedPerson(presence, _figure(person.look, person.height, from_behind))

    def _exposed(self, image: Image, light: float) -> Image:
        """Scale by the light and add noise, in one pass: the noise lies about 128, which is taken off again."""
        if self._grain is None:
            shape = (self._lens.height + _SPREAD, self._lens.width + _SPREAD, 3)
            noise = self._random.standard_normal(shape, np.float32) * np.float32(self._noise)
            self._grain = np.clip(np.rint(noise + 128.0), 0, 255).astype(np.uint8)
        x, y = (int(value) for value in self._random.integers(0, _SPREAD, 2))
        grain = self._grain[y : y + self._lens.height, x : x + self._lens.width]
        return np.asarray(cv2.addWeighted(image, light, grain, 1.0, -128.0), np.uint8)


@lru_cache(maxsize=12)
def _figure(look: str, height: float, from_behind: bool) -> tuple[Sprite, ...]:
    """Return somebody in sizes as ``halved`` makes them; painted once in a process: it takes as long as 50 pictures."""
    figure = paint_figure(LOOKS[look], height, from_behind=from_behind)
    figure.setflags(write=False)
    return halved(figure)
