"""Eyes in simulated time: pictures are taken at intervals, and their percepts arrive after a delay."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from random import Random
from typing import Generic, TypeVar

from config.colours import COLOURS
from drivers.sim.timeline import Timeline
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import SimulatedWorld
from missions.assembly.truth import GroundTruth, SensorNoise, TrueNames
from missions.library.interests import Interests
from perception.api import Face, Gaze, Marker, Scene, Thing, View
from perception.geometry import Pinhole
from perception.identity import FaceNamer
from perception.senses import NewestView
from perception.tracks import FaceSighting, MarkerSighting, ThingSighting, Tracker

__all__ = ["Glimpse", "SensorNoise", "SteppedEyes", "TrueSight"]

T = TypeVar("T")

MIN_LIGHT = 0.08
"""Share of daylight below which simulated eyes see nothing."""


class SteppedEyes(Generic[T]):
    """Takes a picture every ``period`` seconds of a timeline, and processes it ``delay`` seconds later.

    ``take`` returns the picture, or None if there is none; ``see`` processes it. ``looked`` returns the time stamp of
    the newest processed picture, None before the first.
    """

    def __init__(
        self,
        timeline: Timeline,
        take: Callable[[], T | None],
        see: Callable[[T], object],
        looked: Callable[[], float | None],
        *,
        period: float,
        delay: float,
    ) -> None:
        self.looked = looked
        self.may_rest = False
        self._timeline = timeline
        self._take = take
        self._see = see
        self._period = period
        self._delay = delay
        self._opened = self._open = False

    def open(self) -> None:
        """Start to take pictures. Idempotent."""
        self._open = True
        if not self._opened:
            self._opened = True
            self._timeline.call_every(self._period, self._look)

    def close(self) -> None:
        """Stop taking pictures. Idempotent."""
        self._open = False

    def _look(self) -> None:
        if not self._open:
            return
        taken = self._take()
        if taken is not None:
            self._timeline.call_at(self._timeline.clock.now() + self._delay, lambda: self._see(taken))


@dataclass(frozen=True, slots=True)
class Glimpse:
    """All faces, things and markers that a perfect detector finds in the picture taken at ``stamp`` (s)."""

    stamp: float
    scene: Scene
    faces: tuple[FaceSighting, ...] = ()
    things: tuple[ThingSighting, ...] = ()
    markers: tuple[MarkerSighting, ...] = ()


class TrueSight(NewestView):
    """Percepts that come from the simulated world instead of pictures; tracks and ids are made as in real perception.

    ``viewpoint`` returns the true pose of the camera, ``gaze`` the direction that the robot assumes for a past time.
    ``names`` is the recogniser of faces; without it all faces are nameless.
    """

    def __init__(
        self,
        world: SimulatedWorld,
        viewpoint: Callable[[float], Viewpoint],
        gaze: Callable[[float], Gaze | None],
        lens: Pinhole,
        *,
        noise: SensorNoise,
        seed: int,
        on_view: Callable[[View], None],
        interests: Interests | None = None,
        names: TrueNames | None = None,
    ) -> None:
        self._world = world
        self._viewpoint = viewpoint
        self._gaze = gaze
        self._lens = lens
        self._interests = interests or Interests()
        self._truth = GroundTruth(world, lens, noise, Random(seed))  # noqa: S311 - noise is no secret
        self._faces, self._things, self._markers = Tracker[Face](), Tracker[Thing](), Tracker[Marker]()
        self._names, self._naming = names, FaceNamer()
        self._on_view = on_view
        self._last_glimpse: float | None = None

    def glimpse(self, now: float, *, dark: bool = False) -> Glimpse:
        """Return the percepts of a picture taken at ``now``; none through a covered lens (``dark``)."""
        light = 0.0 if dark else self._world.light_at(now)
        scene = Scene(now, brightness=min(255.0, 150.0 * light), contrast=40.0 * min(1.0, light))
        interests, before = self._interests, self._last_glimpse
        self._last_glimpse = now
        if interests.motion:
            scene = replace(scene, motion=0.0)
        if light < MIN_LIGHT:
            return Glimpse(now, scene)
        view, truth = self._viewpoint(now), self._truth
        if interests.motion and before is not None:
            scene = replace(scene, motion=truth.motion(view, before, now))
        return Glimpse(
            now,
            scene,
            truth.faces(view, now) if interests.faces else (),
            truth.things(view, now, interests.objects, COLOURS) if interests.objects else (),
            () if interests.markers is None else truth.markers(view, now, interests.markers),
        )

    def see(self, glimpse: Glimpse) -> None:
        """Replace the percepts that leaves read by those of a new picture, and report them."""
        camera, gaze, stamp, names = self._lens, self._gaze(glimpse.stamp), glimpse.stamp, self._names
        faces = self._faces.update(glimpse.faces, camera=camera, gaze=gaze, stamp=stamp)
        if names is not None:
            faces = self._naming.name(faces, stamp, lambda box: names.look(box, glimpse.faces))
        self._view = View(
            looked=stamp,
            faces=faces,
            things=self._things.update(glimpse.things, camera=camera, gaze=gaze, stamp=stamp),
            markers=self._markers.update(glimpse.markers, camera=camera, gaze=gaze, stamp=stamp),
            scene=glimpse.scene,
        )
        self._on_view(self._view)
