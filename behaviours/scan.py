"""Leaf that scans an area with the head, row by row."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

from py_trees.common import Status

from behaviours.head import ARRIVAL_TOLERANCE, ArrivalDetector, pose_difference, pose_text
from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.search import serpentine
from drivers.api import HeadPose

MAX_STEP_TIME = 0.1
"""Maximum seconds that one tick counts, so that the head does not jump after a late tick or a disconnect."""


class Scan(Leaf):
    """Scan an area with the head: row by row from the lowest, back and forth, within the head's limits.

    Running until the area was scanned `scans` times, then succeeds; the head stays at the last pose. Fails if no part
    of the area is within the limits, or if the head comes to rest elsewhere.
    """

    tag = "scan"
    example = "- scan: {pan: [-60 deg, 60 deg], tilt: [-20 deg, 5 deg], scans: 1}"
    needs = frozenset({"head"})
    drives = frozenset({"head"})
    output_doc = "the pose of the head: pan, tilt"
    output_type = HeadPose
    pan: tuple[float, float] = argument(
        "angle", "range from right (negative) to left", default=(-math.pi / 2, math.pi / 2), span=True
    )
    tilt: tuple[float, float] = argument(
        "angle", "range from up (negative) to down", default=(-math.radians(25), math.radians(10)), span=True
    )
    step: float = argument("angle", "maximum angle from look to look", default=math.radians(30), low=math.radians(2))
    rows: int = argument("count", "number of rows; 0 computes it from the step", default=0, low=0, high=50)
    dwell: float = argument("duration", "duration of each look", default=0.5, low=0.0)
    smooth: bool = argument("flag", "move along each row without stopping, instead of look by look", default=False)
    speed: float = argument("turn rate", "turn rate of the head", default=math.radians(60), low=math.radians(1))
    scans: int = argument("count", "number of scans; 0 scans for ever", default=1, low=0)
    on: str = argument("head", "head to turn, for robots with several", default="head")
    _arrival: ArrivalDetector
    _targets: tuple[HeadPose, ...] = ()
    _route: Iterator[tuple[int, HeadPose]] = iter(())
    _number = 0
    _target: HeadPose | None = None  # where it goes now
    _next_target: tuple[int, HeadPose | None] = 0, None  # where it goes then
    _setpoint: HeadPose | None = None  # how far it has been told to go, at that speed
    _arrived_at: float | None = None
    _ticked_at = 0.0

    def initialise(self) -> None:
        self._targets = self._serpentine()
        rounds = itertools.repeat(0, self.scans) if self.scans else itertools.repeat(0)
        self._route = (place for _ in rounds for place in enumerate(self._targets, 1))
        self._arrival, self._setpoint, self._ticked_at = ArrivalDetector(), None, self.run.now()
        self._next_target = next(self._route, (0, None))
        self._advance()

    def update(self) -> Status:
        head, now, place = self.robot.head, self.run.now(), self._target
        reading = head.pose()
        aim = self._setpoint or reading.value
        if place is None:
            return self.fail("no part of the area is within the head's limits")
        if aim is None:
            return self.wait("the head has not reported its pose yet")
        self._setpoint = head.look(step_towards(place, aim, self.speed * min(now - self._ticked_at, MAX_STEP_TIME)))
        self._ticked_at = now
        sent = pose_difference(self._setpoint, place) <= ARRIVAL_TOLERANCE / 10
        arrived = self._arrival(reading, self._setpoint, now) and sent
        if self._arrival.stuck and reading.value is not None:
            return self.fail(f"the head rests at {pose_text(reading.value)} and does not reach {pose_text(place)}")
        number, self.result = self._number, reading.value
        if self._has_passed(sent=sent, arrived=arrived) if self.smooth else self._has_dwelt(arrived, now):
            self._advance()
        if self._target is None:
            return SUCCESS
        return self.wait(
            f"look {number} of {len(self._targets)}: {pose_text(reading.value or aim)}, to {pose_text(place)}"
        )

    def on_pause(self) -> None:
        super().on_pause()
        self._arrival, self._setpoint, self._arrived_at = (
            ArrivalDetector(),
            None,
            None,
        )  # from where it has come to rest

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()

    def _advance(self) -> None:
        (self._number, self._target), self._next_target = self._next_target, next(self._route, (0, None))
        self._arrived_at = None

    def _has_passed(self, *, sent: bool, arrived: bool) -> bool:
        """Return True if a smooth scan, which does not stop at its poses, may send its next target.

        It may do so as soon as the present target was ``sent``; at the last target the head must have ``arrived``.
        """
        return arrived if self._next_target[1] is None else sent

    def _has_dwelt(self, arrived: bool, now: float) -> bool:
        """Return True if the head has been at its target for ``dwell`` seconds."""
        if not arrived:
            self._arrived_at = None
        elif self._arrived_at is None:
            self._arrived_at = now
        return self._arrived_at is not None and now - self._arrived_at >= self.dwell

    def _serpentine(self) -> tuple[HeadPose, ...]:
        """Return the poses of the head in one round of the scan; only the ends of the rows for a smooth scan."""
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


def step_towards(goal: HeadPose, start: HeadPose, angle: float) -> HeadPose:
    """Return the pose ``angle`` radians from ``start`` on the straight line to ``goal``, but not beyond the goal."""
    way = pose_difference(goal, start)
    if way <= angle:
        return goal
    share = angle / way
    return replace(
        start, pan=start.pan + share * (goal.pan - start.pan), tilt=start.tilt + share * (goal.tilt - start.tilt)
    )
