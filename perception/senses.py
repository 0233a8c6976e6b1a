"""The senses of the eyes: each finds one kind of thing in frame after frame, and follows it. Frames have a source."""

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
        """Search the next frame, taken through ``camera`` that looked to ``gaze``; return what is followed now."""
        ...


@runtime_checkable
class FrameSkipper(Protocol):
    """A sense that need not be shown every frame."""

    def skip_frames(self, limit: int) -> int:
        """Return how many of the next frames, up to ``most``, nobody needs to show it, and count them as shown."""
        ...


class SceneSense(Protocol):
    """A sense that measures a picture as a whole. For one thread at a time."""

    def measure(self, frame: Frame) -> Scene:
        """Return what the next frame shows as a whole."""
        ...


class SightingSource(Protocol):
    """A finder of faces from frame to frame: ``perception.face_finder.FaceFinder``."""

    def find(self, image: Image) -> Sequence[FaceSighting]:
        """Return the faces in the next frame."""
        ...


class FaceSense:
    """Faces, found by ``finder`` and followed by ``tracker``."""

    def __init__(self, finder: SightingSource, tracker: Tracker[Face]) -> None:
        self._finder = finder
        self._tracker = tracker

    def sense(self, frame: Frame, camera: Pinhole, gaze: Gaze | None) -> tuple[Face, ...]:
        """Return the faces followed now, largest first."""
        return self._tracker.update(self._finder.find(frame.image), camera=camera, gaze=gaze, stamp=frame.stamp)

    def skip_frames(self, limit: int) -> int:
        """Return how many of the next frames it can do without: see Sparing."""
        return self._finder.skip_frames(limit) if isinstance(self._finder, FrameSkipper) else 0


@dataclass(frozen=True, slots=True)
class ActiveSenses:
    """Which senses are awake: a detector that nobody listens to does not run.

    ``scene`` replaces the plain measurement of brightness and contrast, which is made once somebody has asked for it.
    """

    faces: Sense[Face] | None = None
    things: Sense[Thing] | None = None
    markers: Sense[Marker] | None = None
    scene: SceneSense | None = None


class FrameSource(Protocol):
    """Where frames come from: a camera."""

    def read(self, timeout: float) -> Frame | None:
        """Wait up to ``timeout`` seconds for a frame newer than the last one read; None when none came."""
        ...


@runtime_checkable
class SkippableSource(Protocol):
    """A source that can let pictures go by, at less cost than to read them: a camera of the house."""

    def skip(self, pictures: int) -> None:
        """Let so many pictures go by after the newest that was read."""
        ...


class NewestView:
    """A ``Sight`` that gives out the newest ``View``, whoever made it."""

    _view = View()

    def faces(self) -> tuple[Face, ...]:
        """The faces followed now, largest first, each with the stamp of the frame that last showed it."""
        return self._view.faces

    def things(self) -> tuple[Thing, ...]:
        """The coloured shapes followed now, largest first."""
        return self._view.things

    def markers(self) -> tuple[Marker, ...]:
        """The markers of other robots followed now, largest first."""
        return self._view.markers

    def looked(self) -> float | None:
        """The stamp of the newest frame that was searched, None before the first."""
        return self._view.looked

    def scene(self) -> Scene | None:
        """What the newest frame shows as a whole, None before the first."""
        return self._view.scene
