"""Looking at pictures and films frame by frame, as a robot's eyes would, without a robot."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path

from config.colours import COLOURS
from drivers.api.senses import CameraKeys
from drivers.camera.source import Kind, kind_of
from missions.assembly.detectors import face_detector
from perception.api import Box, Detection, Image, Marker, Scene, Thing, Wanted
from perception.change import measure
from perception.finder import FaceFinder
from perception.geometry import Pinhole
from perception.identity import Recogniser
from perception.markers import MarkerKind, MarkerSense
from perception.pupils import EyeFinder
from perception.things import ThingSense

IDEAL = CameraKeys(source="", field_of_view=radians(60), width=640, height=480, position=(0.0, 0.0, 0.0))
"""The camera of pictures of which nobody says what has taken them."""

PERIOD = 0.04
"""Seconds that count as passing from frame to frame."""


@dataclass(frozen=True, slots=True)
class Still:
    """A frame: a picture, and its time in seconds."""

    image: Image
    stamp: float


@dataclass(frozen=True, slots=True)
class SeenFace:
    """A face, its eyes, how far away it may be in metres, and whose it is where that was asked and can be said."""

    box: Box
    eyes: tuple[Box, ...]
    distance: float
    name: str = ""


@dataclass(frozen=True, slots=True)
class Seen:
    """All that one frame shows."""

    faces: tuple[SeenFace, ...]
    things: tuple[Thing, ...]
    markers: tuple[Marker, ...]
    scene: Scene


class Looker:
    """Looks at one frame after another: at a picture for itself, at a film from frame to frame.

    ``camera`` is the lens and the detector; ``people`` knows whose the faces are.
    """

    def __init__(
        self,
        camera: CameraKeys,
        things: Sequence[Wanted] = (),
        markers: str | None = None,
        people: Recogniser | None = None,
    ) -> None:
        self._camera = camera
        self._wanted = tuple(things)
        self._family = markers
        self._people = people
        self._detector = face_detector(camera)
        self._eyes = EyeFinder()
        self._film: Path | None = None
        self._begin()

    def look(self, path: Path, number: int, image: Image) -> Seen:
        """Return what frame ``number`` of the file at ``path`` shows. Raises ValueError for a detector's bad file."""
        height, width = image.shape[:2]
        lens = self._lens(width, height)
        still = kind_of(path) is Kind.PICTURE
        if still or path != self._film or number == 0:
            self._begin()
        self._film = None if still else path
        found: Sequence[Detection] = (
            self._detector.detect(image)
            if still
            else [sighting.detection for sighting in self._finder.find(image) if sighting.believed]
        )
        faces = tuple(self._face(image, each.box, lens) for each in found)
        things: tuple[Thing, ...] = ()
        markers: tuple[Marker, ...] = ()
        for look in (0, 1) if still else (1,):  # what is followed counts once it was seen twice: a picture twice over
            frame = Still(image, (number + look) * PERIOD)
            things = self._things.sense(frame, lens, None)
            markers = () if self._markers is None else self._markers.sense(frame, lens, None)
        return Seen(faces, things, markers, measure(image, stamp=number * PERIOD))

    def _face(self, image: Image, box: Box, lens: Pinhole) -> SeenFace:
        look = None if self._people is None else self._people.look(image, box)
        name = "" if look is None else look.verdict
        return SeenFace(box, self._eyes.find(image, box), lens.distance(box), name)

    def _begin(self) -> None:
        """Forget what was followed: another file begins."""
        self._finder = FaceFinder(self._detector)
        self._things = ThingSense(self._wanted, COLOURS)
        self._markers = None if self._family is None else MarkerSense(MarkerKind(self._family))

    def _lens(self, width: int, height: int) -> Pinhole:
        camera, upright = self._camera, self._camera.upright()
        view = camera.turn.view(camera.field_of_view, width, height)
        return Pinhole(width, height, view, upright.centre, upright.bent)
