"""Test bench of a leaf: a run on a robot of recorders."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import radians
from typing import Any, TypeVar

import numpy as np
from py_trees.common import Status

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import NodeCallback, RunState
from drivers.api import (
    ZERO_VELOCITY,
    Base,
    BaseLimits,
    BaseState,
    Coupling,
    GoalState,
    Head,
    HeadLimits,
    HeadPose,
    JointLimits,
    Joints,
    JointState,
    Lamp,
    Legs,
    Lights,
    Mood,
    Pose2D,
    Progress,
    Quality,
    Ranger,
    RangeScan,
    Reading,
    Ros2,
    Screen,
    ScreenContent,
    Sounds,
    Source,
    Steering,
    Tune,
    Velocity,
)
from drivers.api.driver import resolve_name
from drivers.api.gait import GaitKeys
from drivers.api.kinds import KINDS, PartKind
from drivers.clock import ManualClock
from missions.plugins.testing.recorders.senses import (
    ENABLE,
    HOLD,
    LATCH,
    RECOVER,
    RELAX,
    STOP,
    RecordedHearing,
    RecordedSight,
    RecordedVoice,
    Spy,
    good,
    none,
)

# Recorders of a base and a range finder.


def drive(linear: float, angular: float) -> Velocity:
    """Return the recorded form of a drive command, in m/s and rad/s."""
    return Velocity(linear, angular)


class RecordedBase(Spy):
    """A ``drivers.api.Base`` with all capabilities; the test may set some to None.

    The test also sets ``reading``, ``limits``, ``latched``, ``steers`` (the commanding source) and ``performed`` (the
    progress of an act of its legs).
    """

    protocol = Base

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("base", clock)
        self.reading: Reading[BaseState] = good(BaseState(Pose2D(0.0, 0.0, 0.0), ZERO_VELOCITY))
        self.limits = BaseLimits(0.5, radians(110), 0.5, radians(200))
        self.latched = ""
        self.performed = 0.0
        self.sounds: Sounds | None = self
        self.lights: Lights | None = self
        self.legs: Legs | None = self
        self.steers = Steering(None, ZERO_VELOCITY, ZERO_VELOCITY)

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Record the velocity; for sources other than a mission, with the source."""
        self.record(velocity if source is Source.MISSION else (source, velocity))
        return velocity

    def perform(self, act: str, gait: GaitKeys | None = None) -> float:
        """Record the act and the name of its gait; return the progress that the test has set in ``performed``."""
        self.record((act,) if gait is None else (act, gait.gait))
        return self.performed

    def stop(self, *, source: Source | None = None) -> None:
        """Record a stop, whatever its source."""
        del source
        self.record_always(STOP)

    def latch(self, reason: str) -> None:
        """Latch the base, and record the latch."""
        self.latched = self.latched or reason
        self.record_always((LATCH, reason))

    def enable(self) -> None:
        """Release the latch of the base, and record the release."""
        self.latched = ""
        self.record_always(ENABLE)

    def steering(self) -> Steering:
        """Return the commanding source set by the test, as a Steering."""
        return self.steers

    def play(self, tune: Tune) -> None:
        self.record(tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """Record the tone as (hertz, seconds)."""
        self.record((frequency, seconds))

    def light(self, number: int, colour: Lamp) -> None:
        """Record the light and its colour."""
        self.record((number, colour))

    def state(self) -> Reading[BaseState]:
        """Return the reading set by the test."""
        return self.reading

    def heading_at(self, stamp: float) -> float | None:
        """Return the current heading for any ``stamp``, since past headings are not stored."""
        del stamp
        return None if self.reading.value is None else self.reading.value.pose.heading


class RecordedRanger(Spy):
    """A ``drivers.api.Ranger`` in the middle of the base; the test sets ``reading``. At first it detects nothing."""

    protocol = Ranger

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("range", clock)
        self.place = (0.0, 0.0, 0.0)
        self.reading: Reading[RangeScan] = none()
        self.show({})

    def show(self, distances: Mapping[int, float]) -> None:
        """Set the scan: distances (m) by whole degrees, counter-clockwise from straight ahead, stamped now."""
        ranges = np.full(360, np.nan, dtype=np.float32)
        for angle, distance in distances.items():
            ranges[angle % 360] = distance
        number = 0 if self.reading.value is None else self.reading.value.number + 1
        now = self.clock.now()
        scan = RangeScan(ranges, 0.0, radians(1), now, number, least=0.15, most=12.0)
        self.reading = Reading(scan, now, Quality.GOOD)

    def scan(self) -> Reading[RangeScan]:
        """Return the scan set by the test."""
        return self.reading


# Recorders of joints and of a head.


class RecordedHead(Spy):
    """A ``drivers.api.Head``; the test sets ``reading`` and ``limits``."""

    protocol = Head

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("head", clock)
        self.limits = HeadLimits(pan=(-1.4, 1.4), tilt=(-1.0, 0.35), speed=2.0)
        self.reading: Reading[HeadPose] = good(HeadPose(0.0, 0.0))

    def look(self, target: HeadPose) -> HeadPose:
        """Record the pose, clamped to the limits."""
        return self.record(self.limits.clamp(target))

    def pose(self) -> Reading[HeadPose]:
        """Return the pose reading set by the test."""
        return self.reading

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Return the current pose for any ``stamp``, since past poses are not stored."""
        del stamp
        return self.reading.value

    def stop(self) -> None:
        """Record a stop."""
        self.record_always(STOP)


class RecordedJoints(Spy):
    """A ``drivers.api.Joints``; the test sets ``limits``, the ``readings`` by name, and the joints ``shut`` down.

    Moves are recorded as mappings of goals, with their speeds in ``speeds``; couplings as tuples.
    """

    protocol = Joints

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("arm", clock)
        self.limits: dict[str, JointLimits] = {
            "shoulder": JointLimits(-1.0, 2.0, speed=2.0),
            "elbow": JointLimits(0.0, 2.2, speed=3.0),
        }
        self.readings: dict[str, Reading[JointState]] = {}
        self.speeds: list[Mapping[str, float]] = []
        self.shut: tuple[str, ...] = ()
        self.place({"shoulder": 0.0, "elbow": 0.0})

    def place(self, positions: Mapping[str, float], *, stiff: bool = True) -> None:
        """Set measured joint angles in radians, stamped now."""
        for joint, position in positions.items():
            self.set_state(joint, JointState(position, 0.0, None, 0.0, 12.0, 30.0, moving=False, torque=stiff))

    def set_state(self, joint: str, state: JointState) -> None:
        """Set the measured state of a joint, stamped now."""
        self.readings[joint] = Reading(state, self.clock.now(), Quality.GOOD)

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Record the goals and the speeds."""
        kept = self.record(dict(goals))
        self.speeds.append(dict(speeds or {}))
        return kept

    def states(self) -> Mapping[str, Reading[JointState]]:
        """Return the readings of the joints set by the test, by joint."""
        return self.readings

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Record a hold of ``joints``, or of all joints for None."""
        self.record_always(HOLD if joints is None else (HOLD, *joints))

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Record a relax of ``joints``, or of all joints for None."""
        self.record_always(RELAX if joints is None else (RELAX, *joints))

    def follow(self, couplings: Sequence[Coupling]) -> None:
        self.record(tuple(couplings))

    def recover(self) -> tuple[str, ...]:
        """Record a recovery; return the joints that were shut down."""
        self.record(RECOVER)
        recovered, self.shut = self.shut, ()
        return recovered


# Recorder of ROS 2 requests.


class RecordedRos2(Spy):
    """Records the requests to ROS 2: calls, goals, navigations and cancellations.

    ``goal_progress`` is the progress of every request, ``messages`` the latest message by topic, ``nav2`` whether Nav2
    exists.
    """

    protocol = Ros2

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("ros2", clock)
        self.nav2 = False
        self.goal_progress = Progress(GoalState.RUNNING)
        self.messages: dict[str, Reading[str]] = {}

    def navigates(self) -> bool:
        """Return whether Nav2 exists, as set by the test."""
        return self.nav2

    def does(self, name: str) -> bool:
        """Return whether an action or service exists, as set by the test."""
        del name
        return self.nav2

    offers = does

    def nodes(self) -> int:
        """Return the number of nodes: one."""
        return 1

    def latest(self, topic: str) -> Reading[str]:
        """Return the message of a topic set by the test."""
        return self.messages.get(topic, none())

    def progress(self, number: int) -> Progress:
        """Return the progress set by the test for all requests."""
        del number
        return self.goal_progress

    def call(self, *arguments: str) -> int:
        return self._record_request("call", arguments)

    def begin(self, *arguments: str) -> int:
        """Record a goal sent to an action, and return the number of the request."""
        return self._record_request("begin", arguments)

    def navigate(self, *arguments: object) -> int:
        """Record a request to drive to one or more places."""
        return self._record_request("navigate", arguments)

    def _record_request(self, word: str, arguments: tuple[object, ...]) -> int:
        self.record((word, *arguments))
        return len(self.commands)

    def cancel(self, number: int) -> None:
        """Record the cancellation of a request."""
        self.record_always(("cancel", number))

    def stop(self) -> None:
        """Record the cancellation of all requests."""
        self.record_always(STOP)


# Recorder of a screen.


class RecordedScreen(Spy):
    """A ``drivers.api.Screen`` that records moods, texts and mouth openings in one list.

    Like the real one, it raises no errors. ``now`` is its current content.
    """

    protocol = Screen

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("screen", clock)
        self.now = ScreenContent()

    def mood(self, mood: Mood) -> None:
        self.record_always(mood)
        self.now = ScreenContent(mood, self.now.text, self.now.mouth)

    def show(self, text: str) -> None:
        self.record_always(text)
        self.now = ScreenContent(self.now.mood, text, self.now.mouth)

    def mouth(self, opening: float) -> None:
        self.record_always(opening)
        self.now = ScreenContent(self.now.mood, self.now.text, opening)

    def content(self) -> ScreenContent:
        """Return the current content."""
        return self.now


L = TypeVar("L", bound=Leaf)


class LeafTestBench:
    """Test bench of a leaf: a run on a robot of recorders.

    ``safe_stops`` lists each set of parts that the run stopped because a leaf did not stop them in time.
    ``status_changes`` has the name and new status of nodes, in order. ``others`` are plain spies for the parts without
    a recorder, by field of ``Robot``.
    """

    def __init__(self, clock: ManualClock | None = None) -> None:
        self.clock = ManualClock(100.0) if clock is None else clock
        self.run = RunState(self.clock)
        self.base = RecordedBase(self.clock)
        self.ranger = RecordedRanger(self.clock)
        self.head = RecordedHead(self.clock)
        self.arm = RecordedJoints(self.clock)
        self.voice = RecordedVoice(self.clock)
        self.sight = RecordedSight()
        self.sight.searched = self.clock.now()
        self.hearing = RecordedHearing(self.clock)
        self.screen = RecordedScreen(self.clock)
        self.ros2 = RecordedRos2(self.clock)
        self.robot = Robot(
            base_part=self.base,
            ranger_part=self.ranger,
            head_part=self.head,
            arm_part=self.arm,
            voice_part=self.voice,
            sight_part=self.sight,
            hearing_part=self.hearing,
            screen_part=self.screen,
            ros2_part=self.ros2,
        )
        unwritten = (kind for kind in KINDS.values() if not hasattr(self, kind.field))
        self.others = {kind.field: plain_spy(kind, self.clock) for kind in unwritten}
        parts: Any = {f"{field}_part": recorder for field, recorder in self.others.items()}
        self.robot = replace(self.robot, **parts)
        self.safe_stops: list[frozenset[str]] = []
        self.run.safe_stop = self.safe_stops.append
        self.status_changes: list[tuple[str, Status]] = []
        self.run.observer = NodeCallback(lambda node: self.status_changes.append((node.name, node.status)))

    def put(self, leaf: L, **arguments: object) -> L:
        """Give ``leaf`` the run, the robot and its arguments, as a mission would."""
        leaf.run, leaf.robot, leaf.kind = self.run, self.robot, leaf.tag or leaf.name
        leaf.scope = self.run.variables
        for name, value in arguments.items():
            setattr(leaf, name, value)
        return leaf

    def tick(self, node: Node, *, after: float = 0.05) -> Status:
        """Advance the clock by ``after`` seconds, then tick once."""
        self.clock.advance(after)
        self.run.tick += 1
        return node.execute_tick()

    def halt(self, node: Node, *, after: float = 0.05) -> bool:
        """Advance the clock by ``after`` seconds, then halt the node as a tick does; return whether it has halted."""
        self.clock.advance(after)
        self.run.tick += 1
        return node.halt()


def plain_spy(kind: PartKind, clock: ManualClock) -> Spy:
    """Return a spy for parts of a kind. It records the commands that the kind's protocol declares."""
    protocol = resolve_name(kind.leaf_protocol or kind.protocol)
    spy_class: type[Spy] = type(f"Recorded{protocol.__name__}", (Spy,), {"protocol": protocol})
    return spy_class(kind.name, clock)
