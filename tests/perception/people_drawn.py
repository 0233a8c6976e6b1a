"""Drawn people, each alone before the camera, at many distances and in many lights; and faces of real people."""

from math import atan2, radians
from pathlib import Path

import cv2
import numpy as np
import skimage

from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens as Lens
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from perception.api import Image

LENS = Lens(640, 480, radians(60))
NEAR_DISTANCES = (1.0, 1.25, 1.5)
FAR_DISTANCES = (2.0, 2.5, 3.0)

EYE = 1.1
"""Metres of the camera above the floor; people's eyes are 0.5 m higher."""


def pictures(look: str, distances: tuple[float, ...], *, each: int, seed: int = 0, light: float = 1.0) -> list[Image]:
    """Draw somebody ``each`` times at each of the ``distances`` (m), wherever in the picture."""
    random = np.random.default_rng([seed, sorted(APPEARANCES).index(look)])
    found = []
    for number, away in enumerate(distances):
        world = SimulatedWorld(people=(Person(look, look, x=away, y=0.0),), light=light)
        renderer = Renderer(world, LENS, seed=seed + number)
        for _ in range(each):
            pitch = -atan2(0.5, away) + random.uniform(-0.1, 0.1)
            view = Viewpoint(0.0, 0.0, EYE, yaw=random.uniform(-0.25, 0.25), pitch=pitch)
            found.append(renderer.draw(view, 0.0))
    return found


def crowd(*looks: str, away: float = 1.5) -> Image:
    """Draw several people side by side."""
    places = [(away, 0.35 * (number - (len(looks) - 1) / 2) * 2) for number in range(len(looks))]
    people = tuple(Person(look, look, x=x, y=y) for look, (x, y) in zip(looks, places, strict=True))
    return Renderer(SimulatedWorld(people=people), LENS).draw(Viewpoint(0.0, 0.0, EYE, pitch=-atan2(0.5, away)), 0.0)


def strangers() -> list[Image]:
    """Return a hundred faces of real people, each filling its picture: 25 x 25 pixels, enlarged (scikit-image)."""
    faces = np.load(Path(skimage.__file__).parent / "data/lfw_subset.npy")[:100]
    return [_enlarged((255 * face).astype(np.uint8)) for face in faces]


def _enlarged(face: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> Image:
    large = cv2.resize(face, (96, 96), interpolation=cv2.INTER_CUBIC)
    return np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2BGR), np.uint8)
