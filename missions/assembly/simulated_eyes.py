"""Eyes in simulated time: a picture is taken when it is due, and what it shows is known a little later."""

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
"""The share of daylight below which it sees nothing."""


class SteppedEyes(Generic[T]):
    """Takes something every ``period`` seconds of a timeline, and has it seen ``delay`` seconds later.

    ``take`` returns None where there is no picture. ``looked`` tells the stamp of the newest that was seen.
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
        """Begin to look. Safe more than once."""
        self._open = True
        if not self._opened:
            self._opened = True
            self._timeline.call_every(self._period, self._look)

    def close(self) -> None:
        """Look no more. Safe more than once."""
        self._open = False

    def _look(self) -> None:
        if not self._open:
            return
        taken = self._take()
        if taken is not None:
            self._timeline.call_at(self._timeline.clock.now() + self._delay, lambda: self._see(taken))


@dataclass(frozen=True, slots=True)
class Glimpse:
    """The percepts of a perfect detector in the picture taken at ``stamp``."""

    stamp: float
    scene: Scene
    faces: tuple[FaceSighting, ...] = ()
    things: tuple[ThingSighting, ...] = ()
    markers: tuple[MarkerSighting, ...] = ()


class TrueSight(NewestView):
    """A ``Sight`` that knows the world and needs no pictures; tracks and ids are those of real perception.

    ``viewpoint`` tells where the camera is now, ``gaze`` where the robot believes that it looked at a past time.
    ``names`` knows whose faces they are; without it none gets a name.
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
        """Return what a picture taken at ``now`` would show; nothing through a covered lens, which is ``dark``."""
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
        """Take in what was glimpsed."""
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
