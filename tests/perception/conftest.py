"""Faces that move: a real one, pasted onto a textured wall wherever a test wants it."""

from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import pytest
import skimage.data

from perception.api import Box, Image
from tests.footage import FOOTAGE

HEAD = Box(151, 13, 146, 190)  # hair to chin of the astronaut
FACE = Box(176, 65, 97, 97)  # of it, what a Haar box shows


@pytest.fixture(scope="session")
def footage() -> Path:
    """The folder of clips of real people with their true places."""
    if not FOOTAGE.is_dir():
        pytest.skip("the recorded clips are not on this machine")
    return FOOTAGE


@pytest.fixture(scope="session")
def astronaut() -> Image:
    """A portrait of one person, in the order blue, green, red."""
    picture: Image = np.ascontiguousarray(skimage.data.astronaut()[:, :, ::-1])
    return picture


class Scene(Protocol):
    """Draws the wall, with a face at each of the given places."""

    def __call__(self, *centres: tuple[float, float], size: float = 1.0) -> tuple[Image, list[Box]]: ...


@pytest.fixture(scope="session")
def scene(astronaut: Image) -> Scene:
    """Return pictures of 640x480 with faces 97 pixels wide times ``size`` at ``centres``, and their true boxes."""
    rng = np.random.default_rng(7)
    wall = cv2.resize(rng.integers(90, 150, (48, 64, 3), dtype=np.uint8), (640, 480), interpolation=cv2.INTER_CUBIC)
    head = astronaut[int(HEAD.y) : int(HEAD.y + HEAD.height), int(HEAD.x) : int(HEAD.x + HEAD.width)]

    def draw(*centres: tuple[float, float], size: float = 1.0) -> tuple[Image, list[Box]]:
        picture = wall.copy()
        boxes = []
        for x, y in centres:
            boxes.append(
                Box(x - FACE.width * size / 2, y - FACE.height * size / 2, FACE.width * size, FACE.height * size)
            )
            left, top = boxes[-1].x - (FACE.x - HEAD.x) * size, boxes[-1].y - (FACE.y - HEAD.y) * size
            place = np.array([[size, 0, left], [0, size, top]])
            cv2.warpAffine(head, place, (640, 480), dst=picture, borderMode=cv2.BORDER_TRANSPARENT)
        return np.asarray(picture, dtype=np.uint8), boxes

    return draw
