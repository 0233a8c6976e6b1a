"""Recorders: a robot's parts that keep what they were told, in order, and feel what the test says.

``base.commands == [drive(0.2, 0.0), STOP]`` is strict: a command too many fails as one too few does. ``times`` says
when each was given.
"""

from collections.abc import Collection, Mapping, Sequence
from math import radians
from typing import TypeVar

import numpy as np
from py_trees.common import Status

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import NodeByNode, Run
from drivers.api import (
    BaseLimits,
    BaseState,
    Coupling,
    HeadLimits,
    HeadPose,
    Health,
    JointLimits,
    JointState,
    Lamp,
    Pose2D,
    Quality,
    RangeScan,
    Reading,
    Source,
    Steering,
    Tune,
    Velocity,
)
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from perception.api import Box, Face, Marker, Scene, Thing

T = TypeVar("T")
L = TypeVar("L", bound=Leaf)
C = TypeVar("C")

STOP, HOLD, RELAX, REST, CANCEL, RECOVER = "stop", "hold", "relax", "rest", "cancel", "recover"
LATCH, ENABLE = "latch", "enable"
"""The commands without a value, as recorders keep them; with joints, as a tuple: ``(HOLD, "elbow")``."""

GONE = NotConnected("the cable is out", hint="plug it in")


def drive(linear: float, angular: float) -> Velocity:
    """Return what a base keeps when it is told to drive so, in m/s and rad/s."""
    return Velocity(linear, angular)


def good(value: T) -> Reading[T]:
    """Return a fresh reading."""
    return Reading(value, 0.0, Quality.GOOD)


def stale(value: T) -> Reading[T]:
    """Return a reading from too long ago."""
    return Reading(value, 0.0, Quality.STALE)


def none() -> Reading[T]:
    """Return the reading of what was never measured."""
    return Reading(None, 0.0, Quality.NONE)


class Recorder:
    """What all recorders have in common: ``trouble`` is raised by every command that may raise, which is not kept."""

    def __init__(self, name: str, clock: ManualClock) -> None:
        self.name = name
        self.clock = clock
        self.commands: list[object] = []
        self.times: list[float] = []
        self.trouble: Exception | None = None

    def keep(self, command: C) -> C:
        """Keep a command, or raise the trouble."""
        if self.trouble is not None:
            raise self.trouble
        return self.keep_anyway(command)

    def keep_anyway(self, command: C) -> C:
        """Keep a command that is safe in any state."""
        self.commands.append(command)
        self.times.append(self.clock.now())
        return command

    def open(self) -> None:
        """Do nothing."""

    def rest(self) -> None:
        """Keep that it was told to rest."""
        self.keep_anyway(REST)

    def close(self) -> None:
        """Do nothing."""

    def health(self) -> Health:
        """Say that it is there, unless it is in trouble."""
        return Health(self.trouble is None, str(self.trouble or ""))


class RecordedBase(Recorder):
    """A ``drivers.api.Base``; the test sets ``reading``, ``limits``, ``latched`` and ``steers``: who has the wheels."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("base", clock)
        self.reading: Reading[BaseState] = good(BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0)))
        self.limits = BaseLimits(0.5, radians(110), 0.5, radians(200))
        self.latched = ""
        self.steers = Steering(None, Velocity(0.0, 0.0), Velocity(0.0, 0.0))

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Keep the velocity; of another source than a mission, with the source."""
        self.keep(velocity if source is Source.MISSION else (source, velocity))
        return velocity

    def stop(self, *, source: Source | None = None) -> None:
        """Keep that it was told to stop, whoever is to."""
        del source
        self.keep_anyway(STOP)

    def latch(self, reason: str) -> None:
        """Be latched, and keep that."""
        self.latched = self.latched or reason
        self.keep_anyway((LATCH, reason))

    def enable(self) -> None:
        """Be latched no more, and keep that."""
        self.latched = ""
        self.keep_anyway(ENABLE)

    def steering(self) -> Steering:
        """Return what the test has set."""
        return self.steers

    def play(self, tune: Tune) -> None:
        """Keep the tune."""
        self.keep(tune)

    def tone(self, frequency: float, seconds: float) -> None:
        """Keep the tone as (hertz, seconds)."""
        self.keep((frequency, seconds))

    def light(self, number: int, colour: Lamp) -> None:
        """Keep the light and its colour."""
        self.keep((number, colour))

    def state(self) -> Reading[BaseState]:
        """Return what the test has set."""
        return self.reading

    def heading_at(self, stamp: float) -> float | None:
        """Return the heading now, for want of a past."""
        del stamp
        return None if self.reading.value is None else self.reading.value.pose.heading


class RecordedRanger(Recorder):
    """A ``drivers.api.Ranger`` in the middle of the base; the test sets ``reading``. Nothing is around it at first."""

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


class RecordedHead(Recorder):
    """A ``drivers.api.Head``; the test sets ``reading`` and ``limits``."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("head", clock)
        self.limits = HeadLimits(pan=(-1.4, 1.4), tilt=(-1.0, 0.35), speed=2.0)
        self.reading: Reading[HeadPose] = good(HeadPose(0.0, 0.0))

    def look(self, target: HeadPose) -> HeadPose:
        """Keep the pose as clamped."""
        return self.keep(self.limits.clamp(target))

    def pose(self) -> Reading[HeadPose]:
        """Return what the test has set."""
        return self.reading

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Return the pose now, for want of a past."""
        del stamp
        return self.reading.value

    def stop(self) -> None:
        """Keep that it was told to stop."""
        self.keep_anyway(STOP)


class RecordedJoints(Recorder):
    """A ``drivers.api.Joints``; the test sets ``limits``, the ``readings`` by name, and which joints are ``shut``.

    It keeps moves as mappings of goals, whose speeds are in ``speeds``, and couplings as tuples.
    """

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
            self.feel(joint, JointState(position, 0.0, None, 0.0, 12.0, 30.0, moving=False, torque=stiff))

    def feel(self, joint: str, state: JointState) -> None:
        """Let a joint feel this, and let that be measured now."""
        self.readings[joint] = Reading(state, self.clock.now(), Quality.GOOD)

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Keep the goals, and the speeds."""
        kept = self.keep(dict(goals))
        self.speeds.append(dict(speeds or {}))
        return kept

    def states(self) -> Mapping[str, Reading[JointState]]:
        """Return what the test has set."""
        return self.readings

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Keep that it, or these joints, were told to hold."""
        self.keep_anyway(HOLD if joints is None else (HOLD, *joints))

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Keep that it, or these joints, were told to relax."""
        self.keep_anyway(RELAX if joints is None else (RELAX, *joints))

    def follow(self, couplings: Sequence[Coupling]) -> None:
        """Keep the couplings."""
        self.keep(tuple(couplings))

    def recover(self) -> tuple[str, ...]:
        """Keep that it was told to recover; return those that were shut."""
        self.keep(RECOVER)
        recovered, self.shut = self.shut, ()
        return recovered


class RecordedWords:
    """A ``drivers.api.Utterance``; the test sets ``ended``."""

    def __init__(self, voice: "RecordedVoice") -> None:
        self.ended = False
        self._voice = voice

    def done(self) -> bool:
        """True once the test, or a cancellation, has ended it."""
        return self.ended

    def cancel(self) -> None:
        """Keep the cancellation, and end."""
        self.ended = True
        self._voice.keep_anyway(CANCEL)


class RecordedVoice(Recorder):
    """A ``drivers.api.Voice``: keeps each text as it is, and the utterances in ``said``."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("voice", clock)
        self.said: list[RecordedWords] = []

    def say(self, text: str) -> RecordedWords:
        """Keep the text."""
        self.keep(text)
        self.said.append(RecordedWords(self))
        return self.said[-1]


class RecordedSight:
    """A ``perception.api.Sight``: the test sets ``seen``, ``searched`` and ``shown``."""

    def __init__(self) -> None:
        self.seen: Sequence[Face] = ()
        self.found: Sequence[Thing] = ()
        self.marked: Sequence[Marker] = ()
        self.searched: float | None = 0.0
        self.shown: Scene | None = None

    def faces(self) -> Sequence[Face]:
        """Return what the test has set."""
        return self.seen

    def things(self) -> Sequence[Thing]:
        """Return what the test has set."""
        return self.found

    def markers(self) -> Sequence[Marker]:
        """Return what the test has set."""
        return self.marked

    def looked(self) -> float | None:
        """Return what the test has set."""
        return self.searched

    def scene(self) -> Scene | None:
        """Return what the test has set."""
        return self.shown


def face(
    stamp: float, *, number: int = 1, bearing: float = 0.0, drop: float = 0.0, yaw: float = 0.0, pitch: float = 0.0
) -> Face:
    """Return a face that stands still, seen at ``stamp``; angles in radians."""
    return Face(
        number,
        stamp,
        Box(300, 220, 40, 40),
        bearing=bearing,
        drop=drop,
        yaw=yaw,
        pitch=pitch,
        yaw_rate=0.0,
        pitch_rate=0.0,
        distance=1.5,
    )


class Bench:
    """A run over a robot of recorders: ``settled`` keeps what had to be stopped for a leaf, ``news`` what changed.

    That ``robot`` takes the recorders is also what holds them to the protocols: mypy checks it.
    """

    def __init__(self, clock: ManualClock | None = None) -> None:
        self.clock = ManualClock(100.0) if clock is None else clock
        self.run = Run(self.clock)
        self.base = RecordedBase(self.clock)
        self.ranger = RecordedRanger(self.clock)
        self.head = RecordedHead(self.clock)
        self.arm = RecordedJoints(self.clock)
        self.voice = RecordedVoice(self.clock)
        self.sight = RecordedSight()
        self.sight.searched = self.clock.now()
        self.robot = Robot(
            base_part=self.base,
            ranger_part=self.ranger,
            head_part=self.head,
            arm_part=self.arm,
            voice_part=self.voice,
            sight_part=self.sight,
        )
        self.settled: list[frozenset[str]] = []
        self.run.settle = self.settled.append
        self.news: list[tuple[str, Status]] = []
        self.run.observer = NodeByNode(lambda node: self.news.append((node.name, node.status)))

    def put(self, leaf: L, **arguments: object) -> L:
        """Give ``leaf`` the run, the robot and its arguments, as a mission would."""
        leaf.run, leaf.robot, leaf.kind = self.run, self.robot, leaf.word or leaf.name
        leaf.scope = self.run.variables
        for name, value in arguments.items():
            setattr(leaf, name, value)
        return leaf

    def tick(self, node: Node, *, after: float = 0.05) -> Status:
        """Let ``after`` seconds pass, then tick once."""
        self.clock.advance(after)
        self.run.tick += 1
        return node.advance()

    def halt(self, node: Node, *, after: float = 0.05) -> bool:
        """Let ``after`` seconds pass, then ask it to halt, as a tick does."""
        self.clock.advance(after)
        self.run.tick += 1
        return node.halt()
