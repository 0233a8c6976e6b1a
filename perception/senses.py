"""Senses, which each detect and track one kind of percept such as faces, and protocols of the sources of frames."""

from collections.abc import Sequence
from typing import Protocol, TypeVar, runtime_checkable

from drivers.api.fast_dataclass import dataclass
from perception.api import Face, Frame, Gaze, Image, Marker, Percept, Scene, Thing, View
from perception.geometry import Pinhole
from perception.tracks import FaceSighting, Tracker

P_co = TypeVar("P_co", bound=Percept, covariant=True)


class Sense(Protocol[P_co]):
    """A sense for one kind of percept. For one thread at a time."""

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[P_co, ...]:
        """Process the next frame, taken by ``camera`` in direction ``gaze``; return the percepts tracked now."""
        ...


@runtime_checkable
class FrameSkipper(Protocol):
    """A sense that does not need every frame."""

    def skip_frames(self, limit: int) -> int:
        """Return how many of the next frames, at most ``limit``, may be skipped, and count them as processed."""
        ...


class SceneSense(Protocol):
    """A sense that measures a whole picture. For one thread at a time."""

    def measure(self, frame: Frame) -> Scene:
        """Return the scene of the next frame."""
        ...


class SightingSource(Protocol):
    """Finder of faces from frame to frame, such as ``perception.face_finder.FaceFinder``."""

    def find(self, image: Image) -> Sequence[FaceSighting]:
        """Return the faces in the next frame."""
        ...


class FaceSense:
    """Sense for faces, found by ``finder`` and tracked by ``tracker``."""

    def __init__(self, finder: SightingSource, tracker: Tracker[Face]) -> None:
        self._finder = finder
        self._tracker = tracker

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Face, ...]:
        return self._tracker.update(self._finder.find(frame.image), camera=camera, gaze=gaze, stamp=frame.stamp)

    def skip_frames(self, limit: int) -> int:
        return self._finder.skip_frames(limit) if isinstance(self._finder, FrameSkipper) else 0


@dataclass(frozen=True, slots=True)
class ActiveSenses:
    """Senses that a mission uses; the others are None and cost nothing.

    Brightness and contrast are measured on request without a sense; a sense ``scene`` measures motion as well.
    """

    faces: Sense[Face] | None = None
    things: Sense[Thing] | None = None
    markers: Sense[Marker] | None = None
    scene: SceneSense | None = None


class FrameSource(Protocol):
    """Source of frames, such as a camera."""

    def read(self, timeout: float) -> Frame | None:
        """Wait up to ``timeout`` seconds for a frame newer than the last one read; None if none arrived."""
        ...


@runtime_checkable
class SkippableSource(Protocol):
    """Source that can skip pictures at less cost than reading them, such as our cameras."""

    def skip(self, pictures: int) -> None:
        """Skip the next ``pictures`` pictures after the newest one that was read."""
        ...


class NewestView:
    """A ``perception.api.Sight`` that returns the parts of the newest ``View``, which subclasses store in ``_view``."""

    _view = View()

    def faces(self) -> tuple[Face, ...]:
        return self._view.faces

    def things(self) -> tuple[Thing, ...]:
        return self._view.things

    def markers(self) -> tuple[Marker, ...]:
        return self._view.markers

    def looked(self) -> float | None:
        return self._view.looked

    def scene(self) -> Scene | None:
        return self._view.scene
