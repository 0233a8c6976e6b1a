"""Rendered scenes with coloured things and robots, seen by a poor camera in some light."""

from dataclasses import dataclass
from math import hypot, pi, radians
from random import Random

import cv2
import numpy as np

from config.colours import COLOURS
from drivers.api import CameraFrame
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens as Lens
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from drivers.sim.world_objects import Rover, WorldBall, WorldBox
from perception.api import Image
from perception.geometry import Pinhole

LENS = Lens(640, 480, radians(60))
CAMERA = Pinhole(640, 480, radians(60))

LIGHTS = {"white": (1.0, 1.0, 1.0), "warm": (1.0, 0.85, 0.62), "cold": (0.72, 0.9, 1.0)}
"""What is left of red, green and blue."""


def poorly(image: Image, random: Random, *, light: str = "white", blur: float = 0.0, noise: float = 0.0) -> Image:
    """Return a picture as a poor camera takes it: ``blur`` in pixels (one sigma), ``noise`` in grey levels."""
    taken = image.astype(np.float32) * np.array(LIGHTS[light][::-1], np.float32)
    if blur > 0:
        taken = np.asarray(cv2.GaussianBlur(taken, (0, 0), blur), np.float32)
    grain = np.random.default_rng(random.randrange(2**32)).normal(0.0, noise, taken.shape)
    return np.asarray(np.clip(np.rint(taken + grain), 0, 255), np.uint8)


def frame(image: Image, stamp: float = 0.0) -> CameraFrame:
    return CameraFrame(image, stamp, 0)


@dataclass(frozen=True)
class Shown:
    """A thing in a picture: its colour and shape, where its middle is (x, y), and its distance along the axis."""

    image: Image
    colour: str
    shape: str
    x: float
    y: float
    ahead: float
    size: float

    def inside(self, x: float, y: float, width: float, height: float) -> bool:
        """Whether a box is on it."""
        return x - 2 <= self.x <= x + width + 2 and y - 2 <= self.y <= y + height + 2


def thing_scene(random: Random, colours: tuple[str, ...]) -> Shown | None:
    """Render a thing at 0.5 to 3 m beside another one; None where the picture would cut it off."""
    colour, shape, away = random.choice(colours), random.choice(("ball", "box")), random.uniform(0.5, 3.0)
    size, angle, bottom = random.uniform(0.1, 0.3), random.uniform(-0.3, 0.3), random.uniform(0.3, 0.6)
    x, y = away * np.cos(angle), away * np.sin(angle)
    view = Viewpoint(z=0.75, pitch=random.uniform(0.0, 0.25), yaw=random.uniform(-0.1, 0.1))
    thing = _thing("it", shape, colour, x, y, bottom, size, random)
    middle = bottom + (thing.size / 2 if isinstance(thing, WorldBall) else thing.size[2] / 2)
    # Of the same colour or of the same shape, on the other side.
    other_shape = random.choice(("ball", "box"))
    other_colour = colour if other_shape != shape else random.choice([name for name in colours if name != colour])
    aside = y - 0.5 * away if y > 0 else y + 0.5 * away
    other = _thing("other", other_shape, other_colour, x, aside, bottom, size, random)
    world = SimulatedWorld(objects=(thing, other), light=random.choice((1.0, 0.5)))
    right, down, ahead = view.to_camera_axes(x, y, middle)
    at = 319.5 + LENS.focal * right / ahead, 239.5 + LENS.focal * down / ahead
    half = LENS.focal * size / (ahead - size / 2) * (0.55 if shape == "ball" else 1.1)
    if not (half < at[0] < 639 - half and half < at[1] < 479 - half):
        return None
    clean = Renderer(world, LENS, noise=0.0).draw(view, 0.0)
    light, blur, noise = random.choice(list(LIGHTS)), random.choice((0.0, 1.0, 2.0)), random.choice((0.0, 4.0, 8.0))
    return Shown(poorly(clean, random, light=light, blur=blur, noise=noise), colour, shape, *at, ahead, size)


def _thing(
    name: str, shape: str, colour: str, x: float, y: float, bottom: float, size: float, random: Random
) -> WorldBall | WorldBox:
    if shape == "ball":
        return WorldBall(name, x, y, size, COLOURS[colour], bottom=bottom)
    sides = (size, size * random.uniform(0.8, 1.25), size * random.uniform(0.8, 1.25))
    return WorldBox(name, x, y, sides, COLOURS[colour], heading=random.uniform(0.0, pi / 2), bottom=bottom)


def marker_picture(
    number: int, away: float, *, turned: float = 0.0, aside: float = 0.0, height: float = 0.3, pitch: float = 0.0
) -> Image:
    """Render a robot whose front is ``away`` m in front and ``aside`` m to the left, turned from us to its left."""
    heading = pi + np.arctan2(aside, away) + turned
    x, y = away - 0.175 * np.cos(heading), aside - 0.175 * np.sin(heading)
    world = SimulatedWorld(robots=(Rover("R2", number, x=float(x), y=float(y), heading=float(heading)),))
    return Renderer(world, LENS, noise=0.0).draw(Viewpoint(z=height, pitch=pitch), 0.0)


def cell(away: float, aside: float, turned: float) -> float:
    """Return how many pixels wide a cell of such a marker is."""
    return float(LENS.focal * 0.15 / 6 / hypot(away, aside) * np.cos(turned))
