"""The base class of leaves that follow something: the head first and the base behind it, or the base alone."""

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
"""Seconds without news of the target for which head and base go on turning after it; nothing drives on that long."""


class TrackLeaf(Leaf):
    """Follows one percept. A subclass says which: ``percepts``, largest first, and ``noun``, what it calls them.

    Once it follows one it stays with that, by its id, for as long as it is in view; then with one that may be it. What
    was not seen for a moment is taken to go on as it did; then head and base wait.
    """

    ends = frozenset({"failure"})
    needs = frozenset({"camera", "head"})
    drives = frozenset({"head", "base"})
    controller: RuleBases = argument("controller", "the rules to follow by", default="face")
    patience: float = argument("duration", "how long to go on while it is not seen", default=2.0, low=0.1)
    max_turn: float = argument(
        "turn rate", "how fast the base may turn; 0 deg/s keeps it still", default=math.radians(110), low=0.0
    )
    lag: float = argument(
        "duration", "what the base takes to begin what it is told, until that is learnt", default=0.1, low=0.0, high=0.5
    )
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
        """Return what it may follow, largest first."""

    def first_target(self) -> Percept | None:
        """Return the one that it is to follow from the start; None for the largest."""
        return None

    def may_be_target(self, percept: Percept, target: Percept) -> bool:
        """Whether it may be followed in the place of ``target``, which is not in view: any may."""
        del percept, target
        return True

    def stop_reason(self) -> str:
        """Return why it cannot go on, or nothing: for those that do more than turn."""
        return ""

    def forward_speed(self, target: Percept, pan: float) -> float:
        """Return how fast the base is to drive (m/s) with the head turned by ``pan``: not at all, on the spot."""
        del target, pan
        return 0.0

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _choose(self, percepts: Sequence[Percept]) -> Percept | None:
        """Stay with the one that is followed, else take the largest that may be it."""
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
        """Say why the base was stopped because it did not do what it was told, or nothing."""
        return "" if self.robot.base_part is None else motion_fault_reason(self.robot.base.steering())

    def _base(self, now: float) -> TurnState:
        """Return how the base stands and turns; a robot without a base stands still."""
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

    Running while there is a face to follow; it never succeeds. Fails once none was seen for `patience`.
    Once it follows somebody it stays with them, whoever else comes into view, until that face is lost; and then it
    takes up nobody who is known to be another.
    """

    tag = "track_face"
    noun = "face"
    output_doc = FACE_OUTPUT_DOC
    output_type = Face
    controller: RuleBases = argument("controller", "the rules to follow by", default="face", principal=True)
    face: Face | None = argument(
        "face", "whom to begin with, as `as` has kept them; else the largest face", default=None
    )

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def first_target(self) -> Face | None:
        return face_argument(self.face)

    def may_be_target(self, percept: Percept, target: Percept) -> bool:
        return not (isinstance(percept, Face) and isinstance(target, Face)) or may_be_same_person(percept, target)


# The leaf that goes after a person: the face stays in the picture, and the person at a distance.

SPEED_GAIN = 0.8
"""Speed in m/s for each metre too far: with a Kobuki's dead time of 0.25 s it arrives without overshooting."""

DISTANCE_TOLERANCE = 0.1
"""Metres too far that are near enough: the distance is a guess from the size of the face, and trembles."""

MIN_DISTANCE = 0.6
"""Metres to people at least. A TurtleBot 2 (0.18 m) touches a person (0.25 m) at 0.43 m: told to stay 0.5 m behind, it
bumps into people in the simulated rooms, told 0.6 m it does not; nearer by, a face leaves the picture of its camera."""

MAX_DRIVING_PAN = math.radians(45)
"""With the head turned further aside the base only turns: it would drive past the person."""


class FollowPerson(TrackFace):
    """Follow a person: the head and the base turn to their face, and the base drives after them up to `distance`.

    Running while there is a face to follow; it never succeeds. It never drives backwards. With a range finder it slows
    down for whatever is in its way, and stops before it. Fails once no face was seen for `patience`, when it bumps into
    something, comes to a cliff, or a wheel drops, once something has been in its way for 5 s, and while the base is
    stopped until somebody enables it.
    """

    tag = "follow_person"
    needs = frozenset({"camera", "head", "base"})
    optional_parts = frozenset({"range"})
    distance: float = argument("length", "how far to stay behind the person", default=1.0, low=MIN_DISTANCE, high=5.0)
    speed: float = argument("speed", "how fast it may drive", default=0.3, low=0.01, high=0.7)

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
        """Say what the range guard sees in the way, once the base has stood for ``RANGE_GUARD_TIMEOUT`` seconds because of it."""
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
        """Return how fast it may drive straight ahead, as far as the range finder sees: not while it is silent."""
        if self._lookout is None or self.robot.ranger_part is None:
            return math.inf
        seen = self._lookout.points_around(state, self.run.now())
        if seen is None:
            return 0.0
        braking = BRAKING_SHARE * self.robot.base.limits.acceleration
        return safe_speed(free_distance(seen), braking=braking, reaction=REACTION_TIME)


# The leaf that keeps a coloured object in the middle of the picture.


class TrackObject(TrackLeaf):
    """Follow a coloured object with the head, and turn the base when the head nears its limit.

    `track_object: red ball`. Running while there is one to follow; it never succeeds. Fails once none was seen for
    `patience`. Once it follows one it stays with that, whatever else of the kind comes into view, until it is lost.
    """

    tag = "track_object"
    noun = "object"
    senses = frozenset({"things"})
    output_doc = "the object: id, name, colour, shape, yaw, pitch, distance"
    output_type = Thing
    what: ThingSpec = argument("object", "a colour and a shape, or the name of an object", principal=True)

    def percepts(self) -> Sequence[Thing]:
        return matching_things(self.robot.sight.things(), self.what)


# The leaf that keeps another robot in the middle of the picture, by the marker that it wears.


class TrackRobot(TrackLeaf):
    """Follow another robot with the head, and turn the base when the head nears its limit.

    `track_robot: 7` or `track_robot: R2`. Running while its marker is seen; it never succeeds. Fails once it was not
    seen for `patience`.
    """

    tag = "track_robot"
    noun = "robot"
    senses = frozenset({"markers"})
    output_doc = "the robot: id, number, name, yaw, pitch, distance, heading"
    output_type = Marker
    which: str = argument("text", "its marker's number, or its name; else any", default="", principal=True)

    def percepts(self) -> Sequence[Marker]:
        return [marker for marker in self.robot.sight.markers() if is_worn_by(marker, self.which)]
