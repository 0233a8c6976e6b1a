"""Portraits of people to recognise: of folders with pictures, of films, and drawn."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from math import atan2, cos, pi, sin
from pathlib import Path

import cv2
import numpy as np

from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from perception.api import Box, Image
from perception.crops import PORTRAIT_MARGIN, make_portrait
from perception.haar_faces import HaarFaceDetector
from tests.footage import FOOTAGE
from tests.perception.people_drawn import EYE, FAR_DISTANCES, LENS, NEAR_DISTANCES, strangers

CLIPS = ("again", "learn", "sister", "want")

TAUGHT = 3
"""Pictures of each person that teach, where it is not said how many."""

Portraits = Mapping[str, Sequence[Image]]


def folder(where: Path, half: str = "") -> Portraits:
    """Return the portraits of people in a folder: of each picture the largest face, where one is found.

    ``half`` is "first" or "last" for that half of them, in the order of their numbers, or "" for all.
    """
    found = {}
    homes = sorted((path for path in where.iterdir() if path.is_dir()), key=lambda path: (len(path.name), path.name))
    middle = len(homes) // 2
    for home in {"first": homes[:middle], "last": homes[middle:]}.get(half, homes):
        pictures = [cv2.imread(str(path)) for path in sorted(home.iterdir())]
        faces = [shown for each in pictures if each is not None and (shown := _portrait(np.asarray(each, np.uint8)))]
        if len(faces) > TAUGHT:
            found[home.name] = [face for (face,) in faces]
    return found


def changed(shown: Image, random: np.random.Generator) -> Image:
    """Return a portrait turned, framed, lit and packed otherwise, and 30 to 100 pixels large."""
    size, face = shown.shape[0], shown.shape[0] / PORTRAIT_MARGIN
    narrow, lean, zoom = random.uniform(0.84, 1.0), random.normal(0, 0.06), np.exp(random.normal(0, 0.07))
    turn = np.asarray(cv2.getRotationMatrix2D((0, 0), random.normal(0, 7), 1.0))[:, :2]
    linear = zoom * np.array([[narrow, lean / zoom], [0.0, 1.0]]) @ turn
    aside = size / 2 - linear @ np.full(2, size / 2) + random.normal(0, 0.035, 2) * face
    move = np.column_stack([linear, aside])
    turned = cv2.warpAffine(shown, move, (size, size), borderMode=cv2.BORDER_REPLICATE).astype(np.float32)
    down, across = np.mgrid[0:size, 0:size] / size - 0.5
    light, steep = random.uniform(0, 2 * pi), random.uniform(0, 1.6)
    lit = turned / 255 * np.exp(steep * (cos(light) * across + sin(light) * down))[..., None] * random.uniform(0.5, 1.1)
    dark = (255 * np.clip(lit, 0, 1) ** np.exp(random.normal(0, 0.3))).astype(np.uint8)
    scale = min(1.0, random.uniform(30, 100) / face)
    small = cv2.resize(dark, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, int(random.uniform(45, 90))])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)


def _portrait(image: Image) -> tuple[Image] | None:
    """Return the portrait of the largest face; a small picture is given a border first, and enlarged."""
    if max(image.shape) < 240:
        edge = image.shape[1] // 3
        image = np.asarray(cv2.copyMakeBorder(image, edge, edge, edge, edge, cv2.BORDER_REPLICATE), np.uint8)
        image = np.asarray(cv2.resize(image, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC), np.uint8)
    faces = HaarFaceDetector().detect(image)
    return (make_portrait(image, faces[0].box),) if faces else None


def drawn(
    near: Sequence[float] = NEAR_DISTANCES,
    far: Sequence[float] = FAR_DISTANCES,
    *,
    teach: int = 1,
    each: int = 6,
    seed: int = 11,
) -> tuple[Portraits, Portraits]:
    """Draw people near and far: what teaches (``teach`` at each distance), and what is asked."""
    return _around(near, each=teach, seed=seed), _around(far, each=each, seed=seed + 50)


def _around(distances: Sequence[float], *, each: int, seed: int) -> dict[str, list[Image]]:
    """Return portraits of the drawn people, who stand in a circle around the camera and are looked at one by one."""
    random, detector = np.random.default_rng(seed), HaarFaceDetector()
    places = {look: 2 * pi * number / len(APPEARANCES) for number, look in enumerate(APPEARANCES)}
    found: dict[str, list[Image]] = {look: [] for look in APPEARANCES}
    for number, away in enumerate(distances):
        people = (Person(look, look, x=away * cos(yaw), y=away * sin(yaw)) for look, yaw in places.items())
        renderer = Renderer(SimulatedWorld(people=tuple(people)), LENS, seed=seed + number)
        for look, yaw in places.items():
            for _ in range(each):
                pitch = -atan2(0.5, away) + random.uniform(-0.1, 0.1)
                view = Viewpoint(0.0, 0.0, EYE, yaw=yaw + random.uniform(-0.25, 0.25), pitch=pitch)
                image = renderer.draw(view, 0.0)
                faces = detector.detect(image)
                found[look] += [make_portrait(image, faces[0].box)] if faces else []
    return found


def clips(where: Path = FOOTAGE, *, step: int = 1, pictures: int = TAUGHT) -> tuple[Portraits, Portraits]:
    """Take the faces of the recorded clips, from each ``step``-th frame.

    What teaches is from their first halves, what is asked from the second.
    """
    taught, asked = {}, {}
    for name in CLIPS:
        detector, found = HaarFaceDetector(), list[Image]()
        ends: list[int] = []
        for image in islice(_frames(where / f"{name}.mkv"), 0, None, step):
            faces = detector.detect(image)
            found += [make_portrait(image, faces[0].box)] if faces else []
            ends.append(len(found))
        first = found[: ends[len(ends) // 2]]
        taught[name] = [first[place] for place in np.linspace(0, len(first) - 1, pictures).astype(int)]
        asked[name] = found[len(first) :]
    return taught, asked


def _frames(path: Path) -> Iterator[Image]:
    film = cv2.VideoCapture(str(path))
    try:
        while (frame := film.read())[0]:
            yield np.asarray(frame[1], np.uint8)
    finally:
        film.release()


def hundred() -> dict[str, list[Image]]:
    """Return the faces of ``people_drawn.strangers`` as portraits, each that of somebody else."""
    whole = Box(0.0, 0.0, 96.0, 96.0)
    return {f"stranger {number}": [make_portrait(each, whole)] for number, each in enumerate(strangers())}
