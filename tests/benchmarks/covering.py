"""How many faces are found, how many finds are wrong, and what that costs, beside the course's own call.

``python -m tests.benchmarks.covering`` prints a table: clips of real people with their true places, where they are on
this machine, and rendered people; as they are, in a quarter of the light, against a window, and lit from one side.
"""

import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import cv2.data
import numpy as np

from drivers.sim.appearances import APPEARANCES
from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens, Viewpoint
from drivers.sim.world import SimulatedWorld
from perception.api import Box, Image
from perception.face_finder import FaceFinder
from perception.geometry import FACE_WIDTH
from perception.haar_faces import HaarFaceDetector
from tests.footage import FOOTAGE

CLIPS = ("again.mkv", "learn.mkv", "sister.mkv", "want.mkv")
SECONDS = 8.0
RATE = 20.0

Film = list[tuple[Image, list[Box]]]
"""Frames, each with the true faces in it."""


@dataclass
class Score:
    """Frames, those in which a face was covered, those with a find that is none, and seconds spent."""

    frames: int = 0
    covered: int = 0
    wrong: int = 0
    seconds: float = 0.0

    def add(self, boxes: list[Box], truth: list[Box], seconds: float) -> None:
        """Count one frame."""
        self.frames += 1
        self.covered += any(on(box, true) for box in boxes for true in truth)
        self.wrong += any(not any(on(box, true) for true in truth) for box in boxes)
        self.seconds += seconds


def on(box: Box, true: Box) -> bool:
    """Whether a box is on a face: its middle inside, and enough of it."""
    x, y = box.centre
    return true.x <= x <= true.x + true.width and true.y <= y <= true.y + true.height and box.overlap(true) > 0.3


def clips() -> Iterator[Film]:
    """Yield the clips of real people; none where they are not on this machine."""
    if not FOOTAGE.is_dir():
        return
    truth = json.loads((FOOTAGE / "truth.json").read_text())
    for clip in CLIPS:
        video = cv2.VideoCapture(str(FOOTAGE / clip))
        frames: Film = []
        for boxes in truth[clip]:
            _, image = video.read()
            frames.append((np.asarray(image, np.uint8), [Box(*box) for box in boxes]))
        video.release()
        yield frames


def rendered() -> Iterator[Film]:
    """Yield each of the drawn people, walking to and fro before the camera."""
    lens, view = PinholeLens(640, 480, math.radians(60)), Viewpoint(z=1.1, pitch=math.radians(-12))
    for number, look in enumerate(sorted(APPEARANCES)):
        x, y = 1.2 + 0.25 * number, 0.35 + 0.05 * number
        person = Person("somebody", look=look, x=x, y=y, path=((x, -y),), speed=0.4 + 0.08 * number)
        world = SimulatedWorld(people=(person,))
        renderer = Renderer(world, lens, seed=number)
        yield [
            (renderer.draw(view, count / RATE), [_face(world, lens, view, count / RATE)])
            for count in range(int(SECONDS * RATE))
        ]


def _face(world: SimulatedWorld, lens: PinholeLens, view: Viewpoint, time: float) -> Box:
    """Return where the face of the one person in a world is in the picture."""
    (who,) = world.people_at(time)
    right, down, ahead = view.to_camera_axes(who.x, who.y, who.eye_height - 0.03)
    side = FACE_WIDTH * lens.focal / ahead
    x, y = lens.width / 2 + lens.focal * right / ahead, lens.height / 2 + lens.focal * down / ahead
    return Box(x - side / 2, y - side / 2, side, side)


def dark(image: Image) -> Image:
    """A quarter of the light, with the noise that comes of it."""
    noise = np.random.default_rng(1).normal(0, 2, image.shape)
    return np.clip(image * 0.25 + noise, 0, 255).astype(np.uint8)


def backlit(image: Image) -> Image:
    """A third of the light on everything, and a bright window behind."""
    height, width = image.shape[:2]
    down, across = np.mgrid[0:height, 0:width]
    glare = 110 * np.exp(-(((across - width / 2) / (0.6 * width)) ** 2) - ((down - 0.1 * height) / (0.4 * height)) ** 2)
    return np.asarray(np.clip(image * 0.3 + glare[:, :, None], 0, 255), np.uint8)


def sidelit(image: Image) -> Image:
    """Light from the right: an eighth of it at the left edge, more than all of it at the right."""
    shade = np.linspace(0.15, 1.2, image.shape[1])[None, :, None]
    return np.asarray(np.clip(image * shade, 0, 255), np.uint8)


LIGHTS: dict[str, Callable[[Image], Image]] = {
    "as it is": lambda image: image,
    "dark": dark,
    "backlit": backlit,
    "lit from one side": sidelit,
}


def score(films: list[Film], light: Callable[[Image], Image], detector: HaarFaceDetector) -> tuple[Score, Score]:
    """Return how the finder does on films, and how the course's call does, frame by frame in turns."""
    course = cv2.CascadeClassifier(cv2.data.haarcascades + "haarcascade_frontalface_default.xml")
    ours, theirs = Score(), Score()
    for film in films:
        finder = FaceFinder(detector)
        for plain, truth in film:
            image = light(plain)
            began = time.process_time()
            sightings = finder.find(image)
            between = time.process_time()
            found = course.detectMultiScale(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), 1.5, 5)
            ended = time.process_time()
            ours.add([sighting.detection.box for sighting in sightings], truth, between - began)
            theirs.add([Box(*(float(value) for value in box)) for box in found], truth, ended - between)
    return ours, theirs


def main() -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    detector = HaarFaceDetector()
    detector.detect(np.zeros((480, 640), np.uint8))  # the cascade is read before anything is timed
    print(f"{'':<28} {'frames':>6} {'covered':>8} {'wrong':>7} {'course covers':>14} {'cost, of its':>13}")
    for what, films in (("clips", list(clips())), ("rendered", list(rendered()))):
        for name, light in LIGHTS.items() if films else ():
            ours, theirs = score(films, light, detector)
            count = ours.frames
            print(
                f"{what + ', ' + name:<28} {count:>6} {ours.covered / count:>8.1%} {ours.wrong / count:>7.1%} "
                f"{theirs.covered / count:>14.1%} {ours.seconds / theirs.seconds:>13.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
