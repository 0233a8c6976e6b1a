"""What the finder tells of one frame."""

from dataclasses import dataclass

from perception.api import Box, Detection, Face, Percept
from perception.geometry import Pinhole
from perception.tracks import common


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where a face is in one frame: ``found`` there by the detector, or else carried there by optical flow.

    One that is not ``believed`` is a candidate: so far only the search that found it takes it for a face. ``who`` is
    whose it truly is, which only simulated eyes know.
    """

    detection: Detection
    found: bool
    who: str = ""
    believed: bool = True

    @property
    def box(self) -> Box:
        """Where in the frame."""
        return self.detection.box

    @property
    def kind(self) -> str:
        """What it can be followed as: any face may be that of anybody."""
        return "face"

    def distance(self, camera: Pinhole) -> float:
        """Guess how far away it is, in metres."""
        return camera.distance(self.box)

    def percept(self, followed: Percept) -> Face:
        """Return what others are told of it."""
        return Face(**common(followed))
