"""The robot's eyes: the newest frame in, the newest faces out, on a thread of their own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Event, Thread
from typing import Protocol

from perception.api import Face, Frame, Gaze, Image, Scene
from perception.geometry import Pinhole
from perception.scene import measure
from perception.sighting import Sighting
from perception.tracks import Tracker

WAIT = 0.1
"""Seconds to wait for a frame, and to rest after trouble: how long ``close`` may take."""

PAUSE = 0.005
"""Seconds to rest when no frame came: a camera that is closed may say so at once."""


class FrameSource(Protocol):
    """Where frames come from: a camera."""

    def read(self, timeout: float) -> Frame | None:
        """Wait up to ``timeout`` seconds for a frame newer than the last one read; None when none came."""
        ...


class Finder(Protocol):
    """What finds faces from frame to frame: ``perception.finder.FaceFinder``."""

    def find(self, image: Image) -> Sequence[Sighting]:
        """Return the faces in the next frame."""
        ...


@dataclass(frozen=True, slots=True)
class Effort:
    """What seeing has cost since ``open``: frames searched, frames that failed, seconds of searching them."""

    frames: int = 0
    failed: int = 0
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class _Percept:
    """What the newest frame gave; one object, so that readers never see half of it."""

    looked: float | None = None
    faces: tuple[Face, ...] = ()
    scene: Scene | None = None


def unheard() -> None:
    """Do nothing: the ``changed`` callback of eyes that nobody waits for."""


def unseen(stamp: float, faces: tuple[Face, ...]) -> None:
    """Drop a percept: the ``on_percept`` of eyes that nobody records."""


def unreported(trouble: Exception) -> None:
    """Drop an error: the ``on_trouble`` of eyes that nobody listens to. It stays readable in ``trouble``."""


class Eyes:
    """Searches frame after frame and keeps the newest result ready: a ``Sight``.

    ``gaze(stamp)`` tells where the camera looked at a past time, None when that is not known. ``field_of_view`` is the
    camera's, in radians. ``now`` tells the time, to measure the effort. From the eyes' own thread, and to return
    at once: ``on_percept(stamp, faces)`` after each frame, ``changed`` after that, ``on_trouble`` for an error.

    An error (in a frame, the detector or a callback) costs that frame, not the thread: it is kept in ``trouble`` until
    a frame succeeds, and reported when it is not the one before.
    """

    def __init__(
        self,
        source: FrameSource,
        gaze: Callable[[float], Gaze | None],
        *,
        field_of_view: float,
        finder: Finder,
        tracker: Tracker,
        now: Callable[[], float],
        changed: Callable[[], None] = unheard,
        on_percept: Callable[[float, tuple[Face, ...]], None] = unseen,
        on_trouble: Callable[[Exception], None] = unreported,
    ) -> None:
        self._source = source
        self._gaze = gaze
        self._field_of_view = field_of_view
        self._finder = finder
        self._tracker = tracker
        self._now = now
        self._changed = changed
        self._on_percept = on_percept
        self._on_trouble = on_trouble
        self._percept = _Percept()
        self._effort = Effort()
        self._trouble: Exception | None = None
        self._ending = Event()
        self._thread: Thread | None = None

    def open(self) -> None:
        """Start looking; returns at once. Safe more than once."""
        if self._thread is not None:
            return
        self._ending.clear()
        self._effort = Effort()
        self._thread = Thread(target=self._run, name="eyes", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread and wait for it. Safe from any state, more than once, but not from a callback."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def faces(self) -> tuple[Face, ...]:
        """The faces followed now, largest first, each with the stamp of the frame that last showed it."""
        return self._percept.faces

    def looked(self) -> float | None:
        """The stamp of the newest frame that was searched, None before the first."""
        return self._percept.looked

    def scene(self) -> Scene | None:
        """What the newest frame shows as a whole, None before the first."""
        return self._percept.scene

    @property
    def effort(self) -> Effort:
        """What it has cost so far."""
        return self._effort

    @property
    def trouble(self) -> Exception | None:
        """Why the newest frame could not be searched; None when it could."""
        return self._trouble

    def _run(self) -> None:
        while not self._ending.is_set():
            try:
                frame = self._source.read(WAIT)
                if frame is None:
                    self._ending.wait(PAUSE)
                    continue
                self._see(frame)
                self._trouble = None
            except Exception as error:  # whatever it is, a robot that goes blind for good is worse
                self._note(error)
                self._ending.wait(WAIT)

    def _see(self, frame: Frame) -> None:
        """Search one frame and publish what it shows."""
        began = self._now()
        height, width = frame.image.shape[:2]
        faces = self._tracker.update(
            self._finder.find(frame.image),
            camera=Pinhole(width, height, self._field_of_view),
            gaze=self._gaze(frame.stamp),
            stamp=frame.stamp,
        )
        scene = measure(frame.image, stamp=frame.stamp)
        spent = self._now() - began
        self._effort = Effort(self._effort.frames + 1, self._effort.failed, self._effort.seconds + spent)
        self._percept = _Percept(frame.stamp, faces, scene)
        self._on_percept(frame.stamp, faces)
        self._changed()

    def _note(self, error: Exception) -> None:
        """Keep an error, and report it unless it is the same as the last."""
        before, self._trouble = self._trouble, error
        self._effort = Effort(self._effort.frames, self._effort.failed + 1, self._effort.seconds)
        if before is not None and (type(before), str(before)) == (type(error), str(error)):
            return
        try:
            self._on_trouble(error)
        except Exception as worse:  # the listener's fault must not blind the robot either
            self._trouble = worse
