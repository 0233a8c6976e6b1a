"""Leaves that follow a target: with the head first and the base after it, or with the base alone."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from py_trees.common import Status

from behaviours.clearance import ObstacleView, free_distance, safe_speed
from behaviours.driving.motion import (
    BRAKING_SHARE,
    RANGE_GUARD_TIMEOUT,
    REACTION_TIME,
    MotionDirection,
    latch_reason,
    motion_fault_reason,
    obstacle_reason,
)
from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.other_robots import is_worn_by
from behaviours.search import matching_things
from behaviours.sight import FACE_OUTPUT_DOC, face_argument, may_be_same_person
from behaviours.tracking.follow import Follower
from behaviours.tracking.fuzzy import RuleBases
from behaviours.tracking.lag_estimator import TurnState
from drivers.api import COMMAND_TIMEOUT, ZERO_VELOCITY, BaseState, HeadPose, Steering, Velocity, is_guarded
from perception.api import Face, Marker, Percept, Thing, ThingSpec

COAST_TIME = 0.6
"""Seconds without a sighting of the target for which head and base keep turning; driving stops earlier."""


class TrackLeaf(Leaf):
    """Base class of leaves that follow one percept.

    Subclasses set ``percepts`` (largest first), and ``noun``, the word for the target in messages: "face". The leaf
    stays with its target by id while that is in view; afterwards it takes a percept that may be the same. For a moment
    without sightings the motion is extrapolated; then head and base wait.
    """

    ends = frozenset({"failure"})
    needs = frozenset({"camera", "head"})
    drives = frozenset({"head", "base"})
    controller: RuleBases = argument("controller", "controller: a name, or a file", default="face")
    patience: float = argument("duration", "maximum time without a sighting", default=2.0, low=0.1)
    max_turn: float = argument(
        "turn rate", "maximum turn rate of the base; 0 deg/s keeps it still", default=math.radians(110), low=0.0
    )
    lag: float = argument("duration", "initial estimate of the base's command lag", default=0.1, low=0.0, high=0.5)
    noun: ClassVar[str] = ""
    _follower: Follower | None = None
    _target: Percept | None = None
    _seen_at = 0.0

    def initialise(self) -> None:
        self._target = self.first_target()
        self._seen_at = self.run.now()
        limits = None if self.robot.head_part is None else self.robot.head.limits
        base, lag, max_turn = self.robot.base_part, self.robot.lag, 0.0
        if base is not None:
            lag.acceleration, max_turn = base.limits.turn_acceleration, self.max_turn
            if not lag.learnt:
                lag.set_prior(self.lag, learnt=False)
        self._follower = Follower(self.controller, limits=limits, max_turn=max_turn, lag=lag)

    def update(self) -> Status:
        trouble = self._motion_fault_reason() or self.stop_reason()
        if trouble:
            return self.fail(trouble)
        now = self.run.now()
        target = self._choose([percept for percept in self.percepts() if now - percept.stamp <= self.patience])
        if target is not None:
            if self._target is None or target.stamp > self._target.stamp:
                self._seen_at = now
            self._target = target
        unseen = now - self._seen_at
        if unseen > self.patience:
            return self.fail(f"no {self.noun} for {self.patience:g} s")
        if self._target is None or self._follower is None or unseen > COAST_TIME:
            self._drive(0.0, 0.0)
            return self.wait(f"no {self.noun} for {unseen:.1f} s")
        self.result = self._target
        return self._follow(now, self._target, self._follower, drives=unseen <= COMMAND_TIMEOUT)

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            if self.robot.head_part is not None:
                self.robot.head.stop()
            if self.robot.base_part is not None:
                self.robot.base.stop()

    # --- what subclasses say ------------------------------------------------------------------------------------------

    @abstractmethod
    def percepts(self) -> Sequence[Percept]:
        """Return the possible targets, largest first."""

    def first_target(self) -> Percept | None:
        """Return the target to start with; None for the largest percept."""
        return None

    def may_be_target(self, percept: Percept, target: Percept) -> bool:
        """Return True if ``percept`` may replace ``target``, which is out of view; always True by default."""
        del percept, target
        return True

    def stop_reason(self) -> str:
        """Return why the leaf cannot continue, or an empty text; for subclasses that do more than turn."""
        return ""

    def forward_speed(self, target: Percept, pan: float) -> float:
        """Return the speed (m/s) of the base with the head at ``pan``; 0 by default, to turn on the spot."""
        del target, pan
        return 0.0

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _choose(self, percepts: Sequence[Percept]) -> Percept | None:
        """Return the percept with the target's id, else the largest that may be the target."""
        target = self._target
        if target is None:
            return next(iter(percepts), None)
        same = next((percept for percept in percepts if percept.id == target.id), None)
        if same is not None:
            return same
        return next((percept for percept in percepts if self.may_be_target(percept, target)), None)

    def _follow(self, now: float, target: Percept, follower: Follower, *, drives: bool) -> Status:
        head = None if self.robot.head_part is None else self.robot.head
        looks = None if head is None else head.pose().value
        command = follower.step(now, target, head=looks or HeadPose(0.0, 0.0), base=self._base(now))
        if head is not None:
            head.look(command.head)
        self._drive(self.forward_speed(target, command.head.pan) if drives else 0.0, command.turn)
        off = math.degrees(max(abs(target.bearing), abs(target.elevation)))
        return self.wait(f"{self.noun} {target.id}, {off:.0f} deg off")

    def _motion_fault_reason(self) -> str:
        """Return the fault for which the base stopped, or an empty text."""
        return "" if self.robot.base_part is None else motion_fault_reason(self.robot.base.steering())

    def _base(self, now: float) -> TurnState:
        """Return heading and turn rate of the base; a robot without a base stands still."""
        reading = None if self.robot.base_part is None else self.robot.base.state()
        if reading is None or reading.value is None:
            return TurnState(0.0, 0.0, now, reported=False)
        heading = reading.value.pose.heading
        if not reading.good:
            # Reports that fail to come say where it was; but not that it still turns, as it stops by itself.
            return TurnState(heading, 0.0, now, reported=False)
        return TurnState(heading, reading.value.velocity.angular, reading.stamp)

    def _drive(self, speed: float, turn: float) -> None:
        if self.robot.base_part is not None:
            self.robot.base.drive(Velocity(speed, turn))


# The leaf that keeps a face in the middle of the picture.


class TrackFace(TrackLeaf):
    """Follow a face with the head, and turn the base when the head nears its limit.

    Running while there is a face to follow; it never succeeds. Fails if no face was seen for `patience`. It stays with
    one person until the face is lost, even if other people come into view. Then it does not switch to a face that is
    known to belong to another person.
    """

    tag = "track_face"
    example = "- track_face: {controller: face, patience: 3 s}"
    noun = "face"
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    controller: RuleBases = argument("controller", "controller: a name, or a file", default="face", principal=True)
    face: Face | None = argument(
        "face", "face to start with, from the output of another behaviour; the largest by default", default=None
    )

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def first_target(self) -> Face | None:
        return face_argument(self.face)

    def may_be_target(self, percept: Percept, target: Percept) -> bool:
        return not (isinstance(percept, Face) and isinstance(target, Face)) or may_be_same_person(percept, target)


# The leaf that goes after a person: the face stays in the picture, and the person at a distance.

SPEED_GAIN = 0.8
"""Speed in m/s per metre of distance error; with this gain, a Kobuki with 0.25 s of dead time does not overshoot."""

DISTANCE_TOLERANCE = 0.1
"""Distance error in metres that is ignored, since the distance is estimated from the size of the face and is noisy."""

MIN_DISTANCE = 0.6
"""Minimum distance in metres between robot and person.

A TurtleBot 2 (radius 0.18 m) touches a person (radius 0.25 m) at 0.43 m. In the simulated rooms it bumps into people
with a minimum of 0.5 m, but not with 0.6 m. Closer by, a face leaves the picture of the robot's camera.
"""

MAX_DRIVING_PAN = math.radians(45)
"""Pan in radians beyond which the base only turns, since it would drive past the person."""


class FollowPerson(TrackFace):
    """Follow a person: head and base turn to the face, and the base drives after the person up to `distance`.

    Running while there is a face to follow; it never succeeds. It never drives backwards. With a range finder it slows
    down and stops at obstacles. Fails if no face was seen for `patience`, after a bump, at a cliff, and when a wheel
    drops. It also fails after 5 s at an obstacle, and while the base is latched.
    """

    tag = "follow_person"
    example = "- follow_person: {distance: 1.2 m, patience: 3 s}"
    needs = frozenset({"camera", "head", "base"})
    optional_parts = frozenset({"range"})
    distance: float = argument("length", "distance to keep from the person", default=1.0, low=MIN_DISTANCE, high=5.0)
    speed: float = argument("speed", "maximum speed", default=0.3, low=0.01, high=0.7)

    _lookout: ObstacleView | None = None
    _guarded_since: float | None = None

    def initialise(self) -> None:
        super().initialise()
        self._guarded_since = None
        self._lookout = ObstacleView(self.robot)

    def stop_reason(self) -> str:
        base = self.robot.base
        state = base.state().value
        steering = base.steering()
        return (
            latch_reason(base)
            or ("" if state is None else obstacle_reason(state, MotionDirection.AHEAD, steering))
            or self._range_guard_reason(steering)
        )

    def _range_guard_reason(self, steering: Steering) -> str:
        """Return the range guard's reason after it has stopped the base for RANGE_GUARD_TIMEOUT, else an empty text."""
        if not is_guarded(steering) or steering.allowed != ZERO_VELOCITY:
            self._guarded_since = None
            return ""
        now = self.run.now()
        if self._guarded_since is None:
            self._guarded_since = now
        return steering.reason if now - self._guarded_since > RANGE_GUARD_TIMEOUT else ""

    def forward_speed(self, target: Percept, pan: float) -> float:
        too_far = target.distance - self.distance - DISTANCE_TOLERANCE
        # Without fresh reports neither an obstacle nor the way gone is known.
        reading = self.robot.base.state()
        if (
            not too_far > 0.0 or abs(pan) >= MAX_DRIVING_PAN or reading.value is None or not reading.good
        ):  # nor does it by a NaN
            return 0.0
        speed = min(SPEED_GAIN * too_far, self.speed, self._safe_speed(reading.value))
        return speed * math.cos(pan * math.pi / 2 / MAX_DRIVING_PAN)

    def _safe_speed(self, state: BaseState) -> float:
        """Return the safe speed straight ahead by the range finder; 0 while the range finder does not report."""
        if self._lookout is None or self.robot.ranger_part is None:
            return math.inf
        points = self._lookout.points_around(state, self.run.now())
        if points is None:
            return 0.0
        braking = BRAKING_SHARE * self.robot.base.limits.acceleration
        return safe_speed(free_distance(points), braking=braking, reaction=REACTION_TIME)


# The leaf that keeps a coloured object in the middle of the picture.


class TrackObject(TrackLeaf):
    """Follow a coloured object with the head, and turn the base when the head nears its limit.

    `track_object: red ball`. Running while there is one to follow; it never succeeds. Fails if none was seen for
    `patience`. It stays with one object until that is lost.
    """

    tag = "track_object"
    example = "- track_object: red ball"
    noun = "object"
    senses = frozenset({"things"})
    output_doc = "the object: id, name, colour, shape, yaw, pitch, distance"
    output_type = Thing
    what: ThingSpec = argument("object", "colour and shape, or the name of an object", principal=True)

    def percepts(self) -> Sequence[Thing]:
        return matching_things(self.robot.sight.things(), self.what)


# The leaf that keeps another robot in the middle of the picture, by the marker that it wears.


class TrackRobot(TrackLeaf):
    """Follow another robot with the head, and turn the base when the head nears its limit.

    `track_robot: 7` or `track_robot: R2`. Running while its marker is seen; it never succeeds. Fails if the marker was
    not seen for `patience`.
    """

    tag = "track_robot"
    example = "- track_robot: 7"
    noun = "robot"
    senses = frozenset({"markers"})
    output_doc = "the robot: id, number, name, yaw, pitch, distance, heading"
    output_type = Marker
    which: str = argument("text", "number of its marker, or its name; any robot by default", default="", principal=True)

    def percepts(self) -> Sequence[Marker]:
        return [marker for marker in self.robot.sight.markers() if is_worn_by(marker, self.which)]
