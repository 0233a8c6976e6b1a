"""Leaves that turn the head to a place: by angles, or to a point."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Generic, TypeVar

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Head, HeadPose, Reading
from perception.api import Percept

# What all leaves have in common that ask whether something is in view: people, things, other robots.

P = TypeVar("P", bound=Percept)

PICTURE_TIMEOUT = 2.0
"""Seconds without a picture searched after which something is missed for want of pictures."""

DEFAULT_MAX_AGE = 0.5
"""Seconds for which what was seen counts as in view, where nothing else is said."""


class PerceptLeaf(Leaf, Generic[P]):
    """Looks for one sort of percept. A subclass says which: ``percepts``, largest first, and ``noun``, its name."""

    needs = frozenset({"camera"})
    noun: ClassVar[str] = ""

    @property
    @abstractmethod
    def age_limit(self) -> float:
        """How long ago (s) still counts."""

    @abstractmethod
    def percepts(self) -> Sequence[P]:
        """Return all that the eyes follow now of this sort, largest first."""

    def matches(self, percept: P) -> bool:
        """Whether it is one of those that are looked for: any."""
        del percept
        return True

    def fresh_percepts(self, *, since: float = -math.inf) -> list[P]:
        """Return those wanted that were seen lately enough to count, and not before ``since``, largest first."""
        oldest = max(since, self.run.now() - self.age_limit)
        return [percept for percept in self.percepts() if percept.stamp >= oldest and self.matches(percept)]

    def largest_fresh(self, *, since: float = -math.inf) -> P | None:
        """Return the largest of those."""
        return next(iter(self.fresh_percepts(since=since)), None)

    def absence_reason(self, so_far: str = "") -> str:
        """Say that none is seen; or that nothing is, which is another trouble."""
        looked = self.robot.sight.looked()
        blind = looked is None or self.run.now() - looked > PICTURE_TIMEOUT
        return "no pictures from the camera" if blind else so_far or f"no {self.noun} in view"

    def fail_absent(self, reason: str = "") -> Status:
        """Fail because none is in view; suspended instead where no picture is new enough to tell."""
        looked = self.robot.sight.looked()
        if looked is None or self.run.now() - looked > max(self.age_limit, DEFAULT_MAX_AGE):
            return self.suspend("camera")
        return self.fail(reason or self.absence_reason())

    def accept(self, percept: P) -> Status:
        """Succeed with ``percept``."""
        self.result = percept
        return SUCCESS


class SeenLeaf(PerceptLeaf[P]):
    """Succeeds with the largest that was seen lately, fails when there is none; suspended without pictures."""

    instant = True

    def update(self) -> Status:
        found = self.largest_fresh()
        return self.accept(found) if found is not None else self.fail_absent()


ARRIVAL_TOLERANCE = math.radians(1.0)
"""Within this angle the head has arrived; a hobby servo takes whole degrees."""

SAG_TOLERANCE = math.radians(3.0)
"""As far from its goal a measured head may come to rest: a servo under load stops short of it."""

SETTLE_TIME = 1.0
"""Seconds without a change after which a head that has not arrived never will: no servo starts that late."""

MIN_LOOK_DISTANCE = 0.02
"""Metres from the camera within which nothing can be looked at."""


class ArrivalDetector:
    """Watches a head on its way to its goals; ``within`` radians of one it has arrived."""

    def __init__(self, within: float = ARRIVAL_TOLERANCE) -> None:
        self._within = within
        self._seen: HeadPose | None = None
        self._goal: HeadPose | None = None
        self._since = 0.0
        self.stuck = False

    def __call__(self, reading: Reading[HeadPose], goal: HeadPose, now: float) -> bool:
        """Say whether the head is at ``goal``, as nearly as its servos can; ``stuck`` when it rests elsewhere."""
        pose = reading.value
        if pose is None or not reading.good:
            self._seen, self.stuck = None, False
            return False
        if (
            self._seen is None
            or self._goal is None
            or pose_difference(pose, self._seen) + pose_difference(goal, self._goal) > ARRIVAL_TOLERANCE / 4
        ):
            self._seen, self._goal, self._since = pose, goal, now
        at_rest = now - self._since >= SETTLE_TIME
        self.stuck = at_rest and pose_difference(pose, goal) > SAG_TOLERANCE
        return has_arrived(reading, goal, self._within) or (at_rest and not self.stuck)


class _HeadTurnLeaf(Leaf):
    """What turns to one pose and is done."""

    needs = frozenset({"head"})
    drives = frozenset({"head"})
    output_doc = "where the head looks: pan, tilt"
    output_type = HeadPose
    _arrival: ArrivalDetector

    def initialise(self) -> None:
        self._arrival = ArrivalDetector()

    def turn(self, target: HeadPose) -> Status:
        """Go on to ``target``; say where the head is, and where it cannot go further."""
        # Said at every tick: a head that was gone for a moment has forgotten where to look.
        goal = self.robot.head.look(target)
        reading = self.robot.head.pose()
        there = self._arrival(reading, goal, self.run.now())
        clamped = pose_difference(goal, target) > ARRIVAL_TOLERANCE
        wanted = f"{pose_text(goal)}, the limit for {pose_text(target)}" if clamped else pose_text(goal)
        if self._arrival.stuck and reading.value is not None:
            return self.fail(f"the head rests at {pose_text(reading.value)} and does not come to {wanted}")
        if not there:
            here = "the head is on its way" if reading.value is None else f"the head is at {pose_text(reading.value)}"
            return self.wait(f"{here}, on its way to {wanted}")
        self.result = reading.value
        self.feedback_message = f"looks at {wanted}{unmeasured_note(self.robot.head)}"
        return SUCCESS

    def on_pause(self) -> None:
        super().on_pause()
        self._arrival = ArrivalDetector()  # at rest on its way, it is not stuck

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()


class LookLeaf(_HeadTurnLeaf):
    """Turn the head.

    Running until the head looks there (or as near as its limits allow), then succeeds. Fails when the head comes to
    rest elsewhere. Hobby servos do not report where they stand: their success says "(not measured)".
    """

    tag = "look"
    pan: float = argument("angle", "positive is to the left", default=0.0, principal=True, low=-math.pi, high=math.pi)
    tilt: float = argument("angle", "positive is down", default=0.0, low=-math.pi / 2, high=math.pi / 2)
    on: str = argument("head", "which head it turns, of a robot that has several", default="head")

    def update(self) -> Status:
        return self.turn(HeadPose(self.pan, self.tilt))


class LookAt(_HeadTurnLeaf):
    """Turn the head to a point: metres from the middle of the base on the floor, as the robot stands now.

    Running until the camera looks at it, then succeeds. Fails when the point is out of the head's reach, or when the
    head comes to rest elsewhere.
    """

    tag = "look_at"
    x: float = argument("length", "how far ahead", low=-100.0, high=100.0)
    y: float = argument("length", "how far to the left", low=-100.0, high=100.0)
    z: float = argument("length", "how high above the floor", low=-100.0, high=100.0)

    def update(self) -> Status:
        target = pose_towards(self.robot.camera_position, (self.x, self.y, self.z))
        if target is None:
            return self.fail(f"({self.x:g}, {self.y:g}, {self.z:g}) m is where the camera is")
        limits = self.robot.head.limits
        if pose_difference(limits.clamp(target), target) > ARRIVAL_TOLERANCE:
            return self.fail(
                f"({self.x:g}, {self.y:g}, {self.z:g}) m is at {pose_text(target)}, beyond the head's limits: "
                f"pan {_range_text(limits.pan)}, tilt {_range_text(limits.tilt)}"
            )
        return self.turn(target)


def pose_towards(eye: tuple[float, float, float], point: tuple[float, float, float]) -> HeadPose | None:
    """Return the pose in which a camera at ``eye`` has ``point`` (both metres, robot's frame) on its axis.

    None for a point so near that it lies in no direction.
    """
    x, y, z = (there - here for there, here in zip(point, eye, strict=True))
    if math.hypot(x, y, z) < MIN_LOOK_DISTANCE:
        return None
    return HeadPose(math.atan2(y, x), math.atan2(-z, math.hypot(x, y)))


def has_arrived(reading: Reading[HeadPose], goal: HeadPose, within: float = ARRIVAL_TOLERANCE) -> bool:
    """True when the head is known to be at ``goal``, within so many radians: as nearly as its servos can."""
    pose = reading.value
    return pose is not None and reading.good and pose_difference(pose, goal) <= within


def unmeasured_note(head: Head) -> str:
    """Return the note that belongs to each success on a head whose servos report nothing."""
    return "" if head.limits.measured else " (not measured)"


def pose_difference(one: HeadPose, other: HeadPose) -> float:
    """Return how far two poses are apart in the axis in which they differ more, in radians."""
    return max(abs(one.pan - other.pan), abs(one.tilt - other.tilt))


def pose_text(pose: HeadPose) -> str:
    """Write a pose for a reason: "+20, -5 deg"."""
    return f"{round(math.degrees(pose.pan)):+d}, {round(math.degrees(pose.tilt)):+d} deg"


def _range_text(ends: tuple[float, float]) -> str:
    return f"{math.degrees(ends[0]):.0f} to {math.degrees(ends[1]):.0f} deg"
