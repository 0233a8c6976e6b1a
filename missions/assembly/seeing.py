"""Eyes in simulated time: a picture is taken when it is due, and what it shows is known a little later."""

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Generic, TypeVar

from drivers.sim.people import Presence
from drivers.sim.timeline import Timeline
from drivers.sim.viewpoint import Viewpoint
from drivers.sim.world import World
from perception.api import Box, Detection, Face, Gaze, Marker, Scene, Thing, View
from perception.geometry import FACE_WIDTH, Pinhole
from perception.sighting import Sighting
from perception.tracks import Tracker

T = TypeVar("T")

FACE_DROP = 0.03
"""Metres from the eyes down to the middle of a Haar box, which reaches from the hairline to the chin."""

SMALLEST = 28.0
"""Pixels of a face's width below which the detector does not see it either (``perception.faces``)."""

DARKEST = 0.08
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
            self._timeline.every(self._period, self._look)

    def close(self) -> None:
        """Look no more. Safe more than once."""
        self._open = False

    def _look(self) -> None:
        if not self._open:
            return
        taken = self._take()
        if taken is not None:
            self._timeline.at(self._timeline.clock.now() + self._delay, lambda: self._see(taken))


@dataclass(frozen=True, slots=True)
class Glimpse:
    """What a perfect detector would find in the picture taken at ``stamp``."""

    stamp: float
    sightings: tuple[Sighting, ...]
    scene: Scene


@dataclass(frozen=True, slots=True)
class Flaws:
    """What true eyes lack: the share of faces missed in each picture, and pixels of noise (one sigma) in each box."""

    missed: float = 0.02
    noise: float = 1.0


class TrueSight:
    """A ``Sight`` that knows the world and needs no pictures; tracks and ids are those of real perception.

    ``viewpoint`` tells where the camera is now, ``gaze`` where the robot believes that it looked at a past time.
    """

    def __init__(
        self,
        world: World,
        viewpoint: Callable[[float], Viewpoint],
        gaze: Callable[[float], Gaze | None],
        lens: Pinhole,
        *,
        flaws: Flaws,
        seed: int,
        on_view: Callable[[View], None],
    ) -> None:
        self._world = world
        self._viewpoint = viewpoint
        self._gaze = gaze
        self._lens = lens
        self._flaws = flaws
        self._random = Random(seed)  # noqa: S311 - noise is no secret
        self._tracker = Tracker()
        self._on_view = on_view
        self._view = View()

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
        """The stamp of the newest picture, None before the first."""
        return self._view.looked

    def scene(self) -> Scene | None:
        """What the newest picture would show as a whole, None before the first."""
        return self._view.scene

    def glimpse(self, now: float, *, dark: bool = False) -> Glimpse:
        """Return what a picture taken at ``now`` would show; nothing through a covered lens, which is ``dark``."""
        light = 0.0 if dark else self._world.light_at(now)
        scene = Scene(now, brightness=min(255.0, 150.0 * light), contrast=40.0 * min(1.0, light))
        if light < DARKEST:
            return Glimpse(now, (), scene)
        view = self._viewpoint(now)
        found = [box for presence in self._world.people_at(now) if (box := self._box(presence, view, now)) is not None]
        found.sort(key=lambda box: -box.width)
        return Glimpse(now, tuple(Sighting(Detection(box, 5.0), found=True) for box in found), scene)

    def _box(self, presence: Presence, view: Viewpoint, now: float) -> Box | None:
        """Return where a face is in the picture; None where it is not to be seen, or is missed this time."""
        if not presence.shows_face(view.x, view.y):
            return None
        height = presence.eyes - FACE_DROP
        right, down, ahead = view.sees(presence.x, presence.y, height)
        if ahead <= 0:
            return None
        lens, flaws, random = self._lens, self._flaws, self._random
        width = FACE_WIDTH * lens.focal / ahead
        x = lens.width / 2 + lens.focal * right / ahead + random.gauss(0.0, flaws.noise)
        y = lens.height / 2 + lens.focal * down / ahead + random.gauss(0.0, flaws.noise)
        half = width / 2
        inside = half <= x <= lens.width - half and half <= y <= lens.height - half
        if not inside or width < SMALLEST or random.random() < flaws.missed:
            return None
        if not self._world.visible((view.x, view.y, view.z), (presence.x, presence.y, height), now):
            return None
        return Box(x - half, y - half, width, width)

    def see(self, glimpse: Glimpse) -> None:
        """Take in what was glimpsed."""
        faces = self._tracker.update(
            glimpse.sightings, camera=self._lens, gaze=self._gaze(glimpse.stamp), stamp=glimpse.stamp
        )
        self._view = View(looked=glimpse.stamp, faces=faces, scene=glimpse.scene)
        self._on_view(self._view)
