"""A run over a robot of recorders."""

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

# A base and a range finder that keep what they were told.


def drive(linear: float, angular: float) -> Velocity:
    """Return what a base keeps when it is told to drive so, in m/s and rad/s."""
    return Velocity(linear, angular)


class RecordedBase(Spy):
    """A ``drivers.api.Base`` with all capabilities, unless the test sets one of them to None.

    The test sets ``reading``, ``limits``, ``latched``, ``steers`` (who commands it) and ``performed`` (the progress of
    an act of its legs), too.
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
        """Keep the velocity; of another source than a mission, with the source."""
        self.record(velocity if source is Source.MISSION else (source, velocity))
        return velocity

    def perform(self, act: str, gait: GaitKeys | None = None) -> float:
        """Keep the act, with the name of a gait; return ``performed``, which the test sets."""
        self.record((act,) if gait is None else (act, gait.gait))
        return self.performed

    def stop(self, *, source: Source | None = None) -> None:
        """Keep that it was told to stop, whoever is to."""
        del source
        self.record_always(STOP)

    def latch(self, reason: str) -> None:
        """Be latched, and keep that."""
        self.latched = self.latched or reason
        self.record_always((LATCH, reason))

    def enable(self) -> None:
        """Be latched no more, and keep that."""
        self.latched = ""
        self.record_always(ENABLE)

    def steering(self) -> Steering:
        """Return what the test has set."""
        return self.steers

    def play(self, tune: Tune) -> None:
        """Keep the tune."""
        self.record(tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """Keep the tone as (hertz, seconds)."""
        self.record((frequency, seconds))

    def light(self, number: int, colour: Lamp) -> None:
        """Keep the light and its colour."""
        self.record((number, colour))

    def state(self) -> Reading[BaseState]:
        """Return what the test has set."""
        return self.reading

    def heading_at(self, stamp: float) -> float | None:
        """Return the heading now, for want of a past."""
        del stamp
        return None if self.reading.value is None else self.reading.value.pose.heading


class RecordedRanger(Spy):
    """A ``drivers.api.Ranger`` in the middle of the base; the test sets ``reading``. Nothing is around it at first."""

    protocol = Ranger

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("range", clock)
        self.place = (0.0, 0.0, 0.0)
        self.reading: Reading[RangeScan] = none()
        self.show({})

    def show(self, distances: Mapping[int, float]) -> None:
        """Let it see something at these distances (m), by whole degrees to the left of straight ahead, now."""
        ranges = np.full(360, np.nan, dtype=np.float32)
        for angle, distance in distances.items():
            ranges[angle % 360] = distance
        number = 0 if self.reading.value is None else self.reading.value.number + 1
        now = self.clock.now()
        scan = RangeScan(ranges, 0.0, radians(1), now, number, least=0.15, most=12.0)
        self.reading = Reading(scan, now, Quality.GOOD)

    def scan(self) -> Reading[RangeScan]:
        """Return what the test has set."""
        return self.reading


# Joints that keep what they were told, and a head.


class RecordedHead(Spy):
    """A ``drivers.api.Head``; the test sets ``reading`` and ``limits``."""

    protocol = Head

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("head", clock)
        self.limits = HeadLimits(pan=(-1.4, 1.4), tilt=(-1.0, 0.35), speed=2.0)
        self.reading: Reading[HeadPose] = good(HeadPose(0.0, 0.0))

    def look(self, target: HeadPose) -> HeadPose:
        """Keep the pose as clamped."""
        return self.record(self.limits.clamp(target))

    def pose(self) -> Reading[HeadPose]:
        """Return what the test has set."""
        return self.reading

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Return the pose now, for want of a past."""
        del stamp
        return self.reading.value

    def stop(self) -> None:
        """Keep that it was told to stop."""
        self.record_always(STOP)


class RecordedJoints(Spy):
    """A ``drivers.api.Joints``; the test sets ``limits``, the ``readings`` by name, and which joints are ``shut``.

    It keeps moves as mappings of goals, whose speeds are in ``speeds``, and couplings as tuples.
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
        """Put joints where they are to be, in radians, and let that be measured now."""
        for joint, position in positions.items():
            self.set_state(joint, JointState(position, 0.0, None, 0.0, 12.0, 30.0, moving=False, torque=stiff))

    def set_state(self, joint: str, state: JointState) -> None:
        """Let a joint feel this, and let that be measured now."""
        self.readings[joint] = Reading(state, self.clock.now(), Quality.GOOD)

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Keep the goals, and the speeds."""
        kept = self.record(dict(goals))
        self.speeds.append(dict(speeds or {}))
        return kept

    def states(self) -> Mapping[str, Reading[JointState]]:
        """Return what the test has set."""
        return self.readings

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Keep that it, or these joints, were told to hold."""
        self.record_always(HOLD if joints is None else (HOLD, *joints))

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Keep that it, or these joints, were told to relax."""
        self.record_always(RELAX if joints is None else (RELAX, *joints))

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Keep the couplings."""
        self.record(tuple(couplings))

    def recover(self) -> tuple[str, ...]:
        """Keep that it was told to recover; return those that were shut."""
        self.record(RECOVER)
        recovered, self.shut = self.shut, ()
        return recovered


# A recorder of the nodes of ROS 2.


class RecordedRos2(Spy):
    """Keeps what was begun, called, sent and cancelled.

    ``goal_progress`` is how far every request has come, ``messages`` the newest messages by topic, ``nav2`` whether there is Nav2.
    """

    protocol = Ros2

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("ros2", clock)
        self.nav2 = False
        self.goal_progress = Progress(GoalState.RUNNING)
        self.messages: dict[str, Reading[str]] = {}

    def navigates(self) -> bool:
        """Whether there is Nav2."""
        return self.nav2

    def does(self, name: str) -> bool:
        """Whether there is anything."""
        del name
        return self.nav2

    offers = does

    def nodes(self) -> int:
        """One node."""
        return 1

    def latest(self, topic: str) -> Reading[str]:
        """Return what the test says of a topic."""
        return self.messages.get(topic, none())

    def progress(self, number: int) -> Progress:
        """Return how far all have come."""
        del number
        return self.goal_progress

    def call(self, *given: str) -> int:
        """Keep a call."""
        return self._record_request("call", given)

    def begin(self, *given: str) -> int:
        """Keep a goal."""
        return self._record_request("begin", given)

    def navigate(self, *given: object) -> int:
        """Keep the places."""
        return self._record_request("navigate", given)

    def _record_request(self, word: str, given: tuple[object, ...]) -> int:
        self.record((word, *given))
        return len(self.commands)

    def cancel(self, number: int) -> None:
        """Keep that a request is cancelled."""
        self.record_always(("cancel", number))

    def stop(self) -> None:
        """Keep that all are."""
        self.record_always(STOP)


# A screen that keeps what it was told.


class RecordedScreen(Spy):
    """A ``drivers.api.Screen``: keeps moods, texts, and openings of the mouth as numbers, in one row.

    Like the real one it raises nothing in trouble. ``now`` is what it shows.
    """

    protocol = Screen

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("screen", clock)
        self.now = ScreenContent()

    def mood(self, mood: Mood) -> None:
        """Keep the mood."""
        self.record_always(mood)
        self.now = ScreenContent(mood, self.now.text, self.now.mouth)

    def show(self, text: str) -> None:
        """Keep the text."""
        self.record_always(text)
        self.now = ScreenContent(self.now.mood, text, self.now.mouth)

    def mouth(self, opening: float) -> None:
        """Keep how far the mouth is to open."""
        self.record_always(opening)
        self.now = ScreenContent(self.now.mood, self.now.text, opening)

    def content(self) -> ScreenContent:
        """Return what it was told."""
        return self.now


L = TypeVar("L", bound=Leaf)


class LeafTestBench:
    """A run over a robot of recorders: ``safe_stops`` keeps what had to be stopped for a leaf, ``status_changes`` what changed.

    That ``robot`` takes the recorders is also what holds them to the protocols: mypy checks it. ``others`` are those of
    parts for which none is written, by their fields in ``Robot``: they keep commands by their names.
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
        """Let ``after`` seconds pass, then tick once."""
        self.clock.advance(after)
        self.run.tick += 1
        return node.execute_tick()

    def halt(self, node: Node, *, after: float = 0.05) -> bool:
        """Let ``after`` seconds pass, then ask it to halt, as a tick does."""
        self.clock.advance(after)
        self.run.tick += 1
        return node.halt()


def plain_spy(kind: PartKind, clock: ManualClock) -> Spy:
    """Return a spy for parts of a kind, by its protocol alone."""
    protocol = resolve_name(kind.leaf_protocol or kind.protocol)
    made: type[Spy] = type(f"Recorded{protocol.__name__}", (Spy,), {"protocol": protocol})
    return made(kind.name, clock)
