"""What seeing costs, against the course's own detector call on the same rendered frames."""

import math
from collections.abc import Iterator

import cv2
import cv2.data

from drivers.sim.people import Person
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import Pinhole, Viewpoint
from drivers.sim.world import World
from perception.api import Image
from perception.faces import HaarFaces
from perception.finder import FaceFinder
from tests.benchmarks.table import Row, compare

FRAMES = 60


def frames() -> list[Image]:
    """Render a person who walks across the view, as the head camera sees it."""
    person = Person("Ben", look="ben", x=1.8, y=0.6, path=((1.8, -0.6),), speed=0.6)
    renderer = Renderer(World(people=(person,)), Pinhole(640, 480, math.radians(60)))
    view = Viewpoint(z=1.1, pitch=math.radians(-12))
    return [renderer.draw(view, number / 20) for number in range(FRAMES)]


def rows() -> Iterator[Row]:
    """Yield the cost of the pipeline, and of our full search of every frame."""
    pictures = frames()
    cascade = cv2.CascadeClassifier(cv2.data.haarcascades + "haarcascade_frontalface_default.xml")
    greys = [cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) for picture in pictures]
    detector = HaarFaces()

    def course() -> int:
        return sum(len(cascade.detectMultiScale(grey, 1.5, 5)) for grey in greys)

    def pipeline() -> int:
        finder = FaceFinder(detector)
        return sum(len(finder.find(picture)) for picture in pictures)

    def every_frame() -> int:
        return sum(len(detector.detect(picture)) for picture in pictures)

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield compare(f"faces in {FRAMES} frames: the pipeline", pipeline, course, calls=1, rounds=3)
        yield compare(f"faces in {FRAMES} frames: full search of each", every_frame, course, calls=1, rounds=3)
    finally:
        cv2.setNumThreads(before)
