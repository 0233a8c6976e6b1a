"""The leaf that lets the head go over an area, row by row."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

from py_trees.common import Status

from behaviours.head import ARRIVED, Arrival, apart, shown
from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.search import serpentine
from drivers.api import HeadPose

LONGEST_STEP = 0.1
"""Seconds: a tick counts for no longer, so that after a late one, or a head that was gone, nothing leaps."""


class Scan(Leaf):
    """Look over an area with the head: row by row from the lowest, to and fro, as far as the limits allow.

    Running until all of it was looked at, `scans` times, then succeeds and the head stays there. Fails when
    nothing of the area is within the limits, or when the head comes to rest where it should not.
    """

    word = "scan"
    needs = frozenset({"head"})
    drives = frozenset({"head"})
    stores = "where the head looks: pan, tilt"
    keeps = HeadPose
    pan: tuple[float, float] = argument(
        "angle", "from right (negative) to left", default=(-math.pi / 2, math.pi / 2), span=True
    )
    tilt: tuple[float, float] = argument(
        "angle", "from up (negative) to down", default=(-math.radians(25), math.radians(10)), span=True
    )
    step: float = argument("angle", "from look to look, at most", default=math.radians(30), low=math.radians(2))
    rows: int = argument("count", "how many rows; 0 is as many as the step asks for", default=0, low=0, high=50)
    dwell: float = argument("duration", "how long to look each time", default=0.5, low=0.0)
    smooth: bool = argument("flag", "go along each row without a halt, instead of look by look", default=False)
    speed: float = argument("turn rate", "how fast", default=math.radians(60), low=math.radians(1))
    scans: int = argument("count", "how many times; 0 is for ever", default=1, low=0)
    on: str = argument("head", "which head it turns, of a robot that has several", default="head")
    _arrival: Arrival
    _places: tuple[HeadPose, ...] = ()
    _route: Iterator[tuple[int, HeadPose]] = iter(())
    _number = 0
    _place: HeadPose | None = None  # where it goes now
    _after: tuple[int, HeadPose | None] = 0, None  # where it goes then
    _aim: HeadPose | None = None  # how far it has been told to go, at that speed
    _there_since: float | None = None
    _ticked = 0.0

    def initialise(self) -> None:
        self._places = self._serpentine()
        rounds = itertools.repeat(0, self.scans) if self.scans else itertools.repeat(0)
        self._route = (place for _ in rounds for place in enumerate(self._places, 1))
        self._arrival, self._aim, self._ticked = Arrival(), None, self.run.now()
        self._after = next(self._route, (0, None))
        self._next()

    def update(self) -> Status:
        head, now, place = self.robot.head, self.run.now(), self._place
        reading = head.pose()
        aim = self._aim or reading.value
        if place is None:
            return self.fail("nothing of the area is within the head's limits")
        if aim is None:
            return self.wait("where the head looks is not known yet")
        self._aim = head.look(towards(place, aim, self.speed * min(now - self._ticked, LONGEST_STEP)))
        self._ticked = now
        told = apart(self._aim, place) <= ARRIVED / 10
        there = self._arrival(reading, self._aim, now) and told
        if self._arrival.stuck and reading.value is not None:
            return self.fail(f"the head rests at {shown(reading.value)} and does not come to {shown(place)}")
        number, self.result = self._number, reading.value
        if self._passed(told=told, there=there) if self.smooth else self._looked(there, now):
            self._next()
        if self._place is None:
            return SUCCESS
        return self.wait(f"look {number} of {len(self._places)}: {shown(reading.value or aim)}, to {shown(place)}")

    def on_pause(self) -> None:
        super().on_pause()
        self._arrival, self._aim, self._there_since = Arrival(), None, None  # from where it has come to rest

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()

    def _next(self) -> None:
        (self._number, self._place), self._after = self._after, next(self._route, (0, None))
        self._there_since = None

    def _passed(self, *, told: bool, there: bool) -> bool:
        """Say whether it goes on from its place without a halt: from the last one it does not, and has to be there."""
        return there if self._after[1] is None else told

    def _looked(self, there: bool, now: float) -> bool:
        """Say whether the head has been at its place for long enough."""
        if not there:
            self._there_since = None
        elif self._there_since is None:
            self._there_since = now
        return self._there_since is not None and now - self._there_since >= self.dwell

    def _serpentine(self) -> tuple[HeadPose, ...]:
        """Return the places of one round; the ends of the rows alone where it goes smoothly."""
        limits = self.robot.head.limits
        pan = max(self.pan[0], limits.pan[0]), min(self.pan[1], limits.pan[1])
        highest, lowest = max(self.tilt[0], limits.tilt[0]), min(self.tilt[1], limits.tilt[1])
        if pan[0] > pan[1] or highest > lowest:
            return ()
        count = self.rows or math.ceil((lowest - highest) / self.step - 1e-9) + 1
        rise = (lowest - highest) / (count - 1) if count > 1 else 0.0
        places: list[HeadPose] = []
        for number in range(count):
            level = lowest - rise * number if count > 1 else (lowest + highest) / 2
            row = [*serpentine(pan, (level, level), self.step)]
            row = [row[0], row[-1]] if self.smooth else row
            places += row if number % 2 == 0 else reversed(row)
        return tuple(places)


def towards(goal: HeadPose, here: HeadPose, reach: float) -> HeadPose:
    """Return the pose on the straight way from ``here`` to ``goal`` that is ``reach`` radians on, or the goal."""
    way = apart(goal, here)
    if way <= reach:
        return goal
    share = reach / way
    return replace(here, pan=here.pan + share * (goal.pan - here.pan), tilt=here.tilt + share * (goal.tilt - here.tilt))
