"""What things, markers and motion cost beside the course's search for faces, on the same rendered frames."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import cv2.data

from config.colours import COLOURS
from config.library import find_file
from config.object import HUES
from config.world import load_world
from drivers.api import CameraFrame
from drivers.sim.render import Renderer
from drivers.sim.viewpoint import PinholeLens as Lens
from drivers.sim.viewpoint import Viewpoint
from missions.library.worlds import build_world
from perception.api import ThingSpec
from perception.colour_spots import ThingSense
from perception.geometry import Pinhole
from perception.markers import MarkerSense
from perception.scene_motion import MotionSense
from perception.tracks import MarkerSet
from tests.benchmarks.table import Row, compare

FRAMES = 20
CAMERA = Pinhole(640, 480, math.radians(60))


def frames() -> list[CameraFrame]:
    """Render the world of coloured things, past which a robot drives, from the height of a head."""
    renderer = Renderer(build_world(load_world(find_file("worlds", "objects"))), Lens(640, 480, math.radians(60)))
    view = Viewpoint(z=0.8, pitch=math.radians(10))
    return [CameraFrame(renderer.draw(view, number / 20), number / 20, number) for number in range(FRAMES)]


def rows() -> Iterator[Row]:
    """Yield the cost of each sense."""
    pictures = frames()
    cascade = cv2.CascadeClassifier(str(Path(cv2.data.haarcascades) / "haarcascade_frontalface_default.xml"))
    greys = [cv2.cvtColor(picture.image, cv2.COLOR_BGR2GRAY) for picture in pictures]

    def course() -> int:
        return sum(len(cascade.detectMultiScale(grey, 1.5, 5)) for grey in greys)

    def searching(sense: ThingSense | MarkerSense) -> Callable[[], int]:
        return lambda: sum(len(sense.sense(picture, CAMERA, None)) for picture in pictures)

    motion = MotionSense()
    ours: dict[str, Callable[[], object]] = {
        "one colour": searching(ThingSense([ThingSpec("red ball", "red", "ball")], COLOURS)),
        "seven colours": searching(ThingSense([ThingSpec(hue, hue) for hue in HUES], COLOURS)),
        "markers": searching(MarkerSense(MarkerSet())),
        "motion": lambda: [motion.measure(picture) for picture in pictures],
    }
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        for name, work in ours.items():
            yield compare(f"{name} in {FRAMES} frames, beside faces", work, course, calls=1, rounds=5)
    finally:
        cv2.setNumThreads(before)
