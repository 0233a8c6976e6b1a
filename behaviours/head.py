"""Leaves that turn the head to angles or to a point, and the base class of leaves that look for percepts."""

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
"""Seconds without a searched picture after which a failure names the camera as the cause."""

DEFAULT_MAX_AGE = 0.5
"""Seconds for which a percept counts as in view by default."""


class PerceptLeaf(Leaf, Generic[P]):
    """Base class of leaves that look for one type of percept.

    Subclasses set ``percepts`` (largest first), and ``noun``, the word for such a percept in messages: "face".
    """

    needs = frozenset({"camera"})
    noun: ClassVar[str] = ""

    @property
    @abstractmethod
    def age_limit(self) -> float:
        """Age in seconds up to which a percept counts as in view."""

    @abstractmethod
    def percepts(self) -> Sequence[P]:
        """Return all tracked percepts of the type, largest first."""

    def matches(self, percept: P) -> bool:
        """Return True if the leaf looks for this percept; all percepts match by default."""
        del percept
        return True

    def fresh_percepts(self, *, since: float = -math.inf) -> list[P]:
        """Return the matching percepts that are recent enough and not older than ``since``, largest first."""
        oldest = max(since, self.run.now() - self.age_limit)
        return [percept for percept in self.percepts() if percept.stamp >= oldest and self.matches(percept)]

    def largest_fresh(self, *, since: float = -math.inf) -> P | None:
        """Return the largest of the ``fresh_percepts``, or None."""
        return next(iter(self.fresh_percepts(since=since)), None)

    def absence_reason(self, so_far: str = "") -> str:
        """Return the reason of a failed search: "no pictures from the camera" if it has sent none recently.

        Otherwise return ``so_far``, or "no face in view" with the leaf's ``noun``.
        """
        looked = self.robot.sight.looked()
        blind = looked is None or self.run.now() - looked > PICTURE_TIMEOUT
        return "no pictures from the camera" if blind else so_far or f"no {self.noun} in view"

    def fail_absent(self, reason: str = "") -> Status:
        """Fail because no percept is in view, or suspend if no picture is recent enough to tell."""
        looked = self.robot.sight.looked()
        if looked is None or self.run.now() - looked > max(self.age_limit, DEFAULT_MAX_AGE):
            return self.suspend("camera")
        return self.fail(reason or self.absence_reason())

    def accept(self, percept: P) -> Status:
        """Store ``percept`` as the result and return SUCCESS."""
        self.result = percept
        return SUCCESS


class SeenLeaf(PerceptLeaf[P]):
    """Base class of conditions that succeed with the largest recent percept, and are suspended without pictures."""

    instant = True

    def update(self) -> Status:
        found = self.largest_fresh()
        return self.accept(found) if found is not None else self.fail_absent()


ARRIVAL_TOLERANCE = math.radians(1.0)
"""Radians from the goal within which the head has arrived, since a hobby servo can only be set to whole degrees."""

SAG_TOLERANCE = math.radians(3.0)
"""Radians from the goal within which a head with measured angles may come to rest, since loaded servos stop short."""

SETTLE_TIME = 1.0
"""Seconds without motion after which a head counts as at rest: as arrived if it is near its goal, else as stuck."""

MIN_LOOK_DISTANCE = 0.02
"""Minimum distance in metres between the camera and a point to look at."""


class ArrivalDetector:
    """Detects whether a moving head has arrived within ``within`` radians of its goal.

    ``stuck`` is True if the head has come to rest elsewhere.
    """

    def __init__(self, within: float = ARRIVAL_TOLERANCE) -> None:
        self._within = within
        self._seen: HeadPose | None = None
        self._goal: HeadPose | None = None
        self._since = 0.0
        self.stuck = False

    def __call__(self, reading: Reading[HeadPose], goal: HeadPose, now: float) -> bool:
        """Return True if the head is at ``goal``, or rests as close as its servos allow. Updates ``stuck``."""
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
    """Base class of leaves that turn the head to one pose."""

    needs = frozenset({"head"})
    drives = frozenset({"head"})
    output_doc = "the pose of the head: pan, tilt"
    output_type = HeadPose
    _arrival: ArrivalDetector

    def initialise(self) -> None:
        self._arrival = ArrivalDetector()

    def turn(self, target: HeadPose) -> Status:
        """Send ``target`` to the head; SUCCESS on arrival, RUNNING on the way, FAILURE if the head is stuck."""
        # Said at every tick: a head that was gone for a moment has forgotten where to look.
        goal = self.robot.head.look(target)
        reading = self.robot.head.pose()
        is_there = self._arrival(reading, goal, self.run.now())
        clamped = pose_difference(goal, target) > ARRIVAL_TOLERANCE
        goal_text = f"{pose_text(goal)}, the limit for {pose_text(target)}" if clamped else pose_text(goal)
        if self._arrival.stuck and reading.value is not None:
            return self.fail(f"the head rests at {pose_text(reading.value)} and does not reach {goal_text}")
        if not is_there:
            position_text = (
                "the head is on its way" if reading.value is None else f"the head is at {pose_text(reading.value)}"
            )
            return self.wait(f"{position_text}, on its way to {goal_text}")
        self.result = reading.value
        self.feedback_message = f"looks at {goal_text}{unmeasured_note(self.robot.head)}"
        return SUCCESS

    def on_pause(self) -> None:
        super().on_pause()
        self._arrival = ArrivalDetector()  # at rest on its way, it is not stuck

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()


class LookLeaf(_HeadTurnLeaf):
    """Turn the head.

    Running until the head looks there (or as near as its limits allow), then succeeds. Fails if the head comes to rest
    elsewhere. Hobby servos do not report their position: the reason of a success then ends with "(not measured)".
    """

    tag = "look"
    example = "- look: {pan: 30 deg, tilt: -10 deg}"
    pan: float = argument(
        "angle", "pan; positive is to the left", default=0.0, principal=True, low=-math.pi, high=math.pi
    )
    tilt: float = argument("angle", "tilt; positive is down", default=0.0, low=-math.pi / 2, high=math.pi / 2)
    on: str = argument("head", "head to turn, for robots with several", default="head")

    def update(self) -> Status:
        return self.turn(HeadPose(self.pan, self.tilt))


class LookAt(_HeadTurnLeaf):
    """Turn the head to a point, in metres from the middle of the base on the floor, as the robot stands now.

    Running until the camera looks at the point, then succeeds. Fails if the point is beyond the head's limits, or if
    the head comes to rest elsewhere.
    """

    tag = "look_at"
    example = "- look_at: {x: 2 m, y: 0 m, z: 1.6 m}"
    x: float = argument("length", "distance ahead", low=-100.0, high=100.0)
    y: float = argument("length", "distance to the left", low=-100.0, high=100.0)
    z: float = argument("length", "height above the floor", low=-100.0, high=100.0)

    def update(self) -> Status:
        target = pose_towards(self.robot.camera_position, (self.x, self.y, self.z))
        if target is None:
            return self.fail(f"({self.x:g}, {self.y:g}, {self.z:g}) m is too close to the camera")
        limits = self.robot.head.limits
        if pose_difference(limits.clamp(target), target) > ARRIVAL_TOLERANCE:
            return self.fail(
                f"({self.x:g}, {self.y:g}, {self.z:g}) m is at {pose_text(target)}, beyond the head's limits: "
                f"pan {_range_text(limits.pan)}, tilt {_range_text(limits.tilt)}"
            )
        return self.turn(target)


def pose_towards(eye: tuple[float, float, float], point: tuple[float, float, float]) -> HeadPose | None:
    """Return the head pose in which a camera at ``eye`` has ``point`` (both in metres, robot's frame) on its axis.

    Returns None if the point is closer than MIN_LOOK_DISTANCE.
    """
    x, y, z = (there - here for there, here in zip(point, eye, strict=True))
    if math.hypot(x, y, z) < MIN_LOOK_DISTANCE:
        return None
    return HeadPose(math.atan2(y, x), math.atan2(-z, math.hypot(x, y)))


def has_arrived(reading: Reading[HeadPose], goal: HeadPose, within: float = ARRIVAL_TOLERANCE) -> bool:
    """Return True if a good reading is within ``within`` radians of ``goal`` on both axes."""
    pose = reading.value
    return pose is not None and reading.good and pose_difference(pose, goal) <= within


def unmeasured_note(head: Head) -> str:
    """Return the note " (not measured)" for a head whose servos do not report their position, else an empty text."""
    return "" if head.limits.measured else " (not measured)"


def pose_difference(one: HeadPose, other: HeadPose) -> float:
    """Return the larger of the two differences in pan and in tilt between two poses, in radians."""
    return max(abs(one.pan - other.pan), abs(one.tilt - other.tilt))


def pose_text(pose: HeadPose) -> str:
    """Return a pose as text: "+20, -5 deg"."""
    return f"{round(math.degrees(pose.pan)):+d}, {round(math.degrees(pose.tilt)):+d} deg"


def _range_text(ends: tuple[float, float]) -> str:
    return f"{math.degrees(ends[0]):.0f} to {math.degrees(ends[1]):.0f} deg"
