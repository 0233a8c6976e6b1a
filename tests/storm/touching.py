"""Touches of a base that its range guard must not let happen: it drives into a thing that was visible in time.

A thing was visible in time if for ``NEEDED`` seconds and the time that the base takes to brake, up to the touch,

- its nearest point was in line of sight of the range finder, in the plane of the scan and within reach; at the end of
  that time it may be too near to be measured,
- it stood still, or moved at one speed of 1 m/s at most,
- the range finder worked.

A base that stands, or moves away, does not drive into anything. Its first contact ends what is looked at: simulated
people walk on through a base that they have walked into.
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, cos, hypot, sin
from typing import Any

from drivers.api import BASE_RADIUS, Pose2D
from drivers.sim.solids import Solid
from drivers.sim.world import SENSOR_HEIGHT, SimulatedWorld

NEEDED = 1.3
"""Seconds, beside braking: a second to see how fast a thing moves, and until the wheels obey."""

MAX_SPEED = 1.0
"""m/s of things, and of the base."""

APPROACH = 0.02
"""m/s towards a thing from which on a base drives into it."""

LOOKED_EVERY = 0.1
"""Seconds between the moments of the past at which the line of sight is looked at."""

KEPT = 6.0
"""Seconds for which poses are kept."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A moment of the base: where it truly is, how fast its wheels drive it (m/s), and whether scans come."""

    time: float
    pose: Pose2D
    speed: float
    scans: bool


@dataclass(frozen=True, slots=True)
class Touch:
    """A touch, and whether the thing was visible in time; ``what`` is its number among the solids of the world."""

    time: float
    what: str
    speed: float
    in_time: bool


class TouchWatch:
    """Looks at the twin of a base in a ``world``, whose range finder sits at ``place``; ``touches`` are what it saw.

    ``acceleration`` in m/s^2 is that of the robot file, ``most`` how far the finder measures, in metres.
    """

    def __init__(
        self,
        world: SimulatedWorld,
        base: Any,
        place: tuple[float, float, float],
        *,
        acceleration: float,
        most: float = 12.0,
        height: float = SENSOR_HEIGHT,
    ) -> None:
        self.touches: list[Touch] = []
        self._world, self._base, self._place = world, base, place
        self._acceleration, self._most, self._height = acceleration, most, height
        self._samples: deque[Sample] = deque()
        self.over = False

    def look(self, now: float, *, scans: bool = True) -> None:
        """Take a sample; note what the base drives into at its first contact."""
        if self.over:
            return
        wheels = self._base.body.wheels
        here = Sample(now, self._base.body.pose, wheels.velocity.linear, scans)
        self._samples.append(here)
        while self._samples[0].time < now - KEPT:
            self._samples.popleft()
        if abs(here.speed) <= APPROACH and round(now * 50) % 5:
            return  # a base that stands drives into nothing: what walks into it is noticed soon enough
        for what, dx, dy in self._near(here):
            self.over = True
            direction = atan2(dy, dx) if dx or dy else here.pose.heading
            if here.speed * cos(direction - here.pose.heading) > APPROACH:
                self.touches.append(Touch(now, what, here.speed, self._in_time(what, now)))

    @property
    def bad(self) -> list[Touch]:
        """The touches of what was visible in time."""
        return [touch for touch in self.touches if touch.in_time]

    def _near(self, here: Sample) -> Iterator[tuple[str, float, float]]:
        """Yield what the body touches, with the vector to its nearest spot."""
        x, y = here.pose.x, here.pose.y
        for what, dx, dy in self._walls(x, y):
            if hypot(dx, dy) <= BASE_RADIUS:
                yield what, dx, dy
        for number, solid in enumerate(self._world.solids(here.time)):
            if self._in_plane(solid):
                dx, dy = solid.nearest_offset(x, y)
                if hypot(dx, dy) <= BASE_RADIUS:
                    yield str(number), dx, dy

    def _walls(self, x: float, y: float) -> Iterator[tuple[str, float, float]]:
        (x_low, x_high), (y_low, y_high) = self._world.room.extent()
        yield from (("west", x_low - x, 0.0), ("east", x_high - x, 0.0))
        yield from (("south", 0.0, y_low - y), ("north", 0.0, y_high - y))

    def _in_plane(self, solid: Solid) -> bool:
        return solid.bottom <= self._height <= solid.top

    def _in_time(self, what: str, now: float) -> bool:
        fastest = max(abs(each.speed) for each in self._samples if now - each.time <= NEEDED + 1.0)
        begin = now - NEEDED - fastest / self._acceleration
        if self._samples[0].time > begin or self._starts(what, begin, now):
            return False
        last = now
        for each in reversed(self._samples):
            if each.time < begin:
                return True
            if not each.scans and each.time <= now - LOOKED_EVERY:  # a run that fails by the touch ends them
                return False
            if each.time <= last - LOOKED_EVERY:
                last = each.time
                if not self._visible(what, each):
                    return False
        return True

    def _starts(self, what: str, begin: float, end: float) -> bool:
        """Say whether a thing sets out, or goes too fast, between two times."""
        if not what.isdigit():
            return False
        times = [begin + LOOKED_EVERY * step for step in range(round((end - begin) / LOOKED_EVERY) + 1)]
        was = [[*self._world.solids(time)][int(what)] for time in times]
        paces = [hypot(b.x - a.x, b.y - a.y) / LOOKED_EVERY for a, b in pairwise(was)]
        return max(paces) > MAX_SPEED + 0.01 or any(before < after / 2 for before, after in pairwise(paces))

    def _visible(self, what: str, then: Sample) -> bool:
        """Say whether the nearest point of a thing was in line of sight of the finder at a time."""
        pose, (ahead, left, _) = then.pose, self._place
        along, across = cos(pose.heading), sin(pose.heading)
        x, y = pose.x + ahead * along - left * across, pose.y + ahead * across + left * along
        if what.isdigit():
            dx, dy = [*self._world.solids(then.time)][int(what)].nearest_offset(x, y)
        else:
            dx, dy = next((dx, dy) for name, dx, dy in self._walls(x, y) if name == what)
        far = hypot(dx, dy)
        if far > self._most:
            return False
        angle = atan2(dy, dx)
        return self._world.distance(x, y, angle, then.time, height=self._height) >= far - 0.01
