"""Recorders: a robot's parts that keep what they were told, in order, and feel what the test says.

``base.commands == [drive(0.2, 0.0), STOP]`` is strict: a command too many fails as one too few does. ``times`` says
when each was given.
"""

from collections.abc import Mapping, Sequence
from typing import TypeVar

from py_trees.common import Status

from behaviours.leaf import Leaf
from behaviours.node import Node
from behaviours.robot import Robot
from behaviours.run import NodeByNode, Run
from drivers.api import (
    BaseState,
    HeadLimits,
    HeadPose,
    Health,
    JointLimits,
    JointState,
    Pose2D,
    Quality,
    Reading,
    Velocity,
)
from drivers.clock import ManualClock
from drivers.errors import NotConnected
from perception.api import Box, Face, Marker, Scene, Thing

T = TypeVar("T")
L = TypeVar("L", bound=Leaf)
C = TypeVar("C")

STOP, HOLD, RELAX, REST, CANCEL = "stop", "hold", "relax", "rest", "cancel"
"""The commands without a value, as recorders keep them."""

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
    """A ``drivers.api.Base``; the test sets ``reading``."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("base", clock)
        self.reading: Reading[BaseState] = good(BaseState(Pose2D(0.0, 0.0, 0.0), Velocity(0.0, 0.0)))

    def drive(self, velocity: Velocity) -> Velocity:
        """Keep the velocity."""
        return self.keep(velocity)

    def stop(self) -> None:
        """Keep that it was told to stop."""
        self.keep_anyway(STOP)

    def state(self) -> Reading[BaseState]:
        """Return what the test has set."""
        return self.reading

    def heading_at(self, stamp: float) -> float | None:
        """Return the heading now, for want of a past."""
        del stamp
        return None if self.reading.value is None else self.reading.value.pose.heading


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
    """A ``drivers.api.Joints``; the test sets ``limits`` and the ``readings`` by name."""

    def __init__(self, clock: ManualClock) -> None:
        super().__init__("arm", clock)
        self.limits: dict[str, JointLimits] = {
            "shoulder": JointLimits(-1.0, 2.0, speed=2.0),
            "elbow": JointLimits(0.0, 2.2, speed=3.0),
        }
        self.readings: dict[str, Reading[JointState]] = {}
        self.place({"shoulder": 0.0, "elbow": 0.0})

    def place(self, positions: Mapping[str, float]) -> None:
        """Put joints where they are to be, in radians."""
        for joint, position in positions.items():
            self.readings[joint] = good(JointState(position, 0.0, None, 0.0, 12.0, 30.0, moving=False, torque=True))

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Keep the goals; speeds are not looked at."""
        del speeds
        return self.keep(dict(goals))

    def states(self) -> Mapping[str, Reading[JointState]]:
        """Return what the test has set."""
        return self.readings

    def hold(self) -> None:
        """Keep that it was told to hold."""
        self.keep_anyway(HOLD)

    def relax(self) -> None:
        """Keep that it was told to relax."""
        self.keep_anyway(RELAX)


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
        self.head = RecordedHead(self.clock)
        self.arm = RecordedJoints(self.clock)
        self.voice = RecordedVoice(self.clock)
        self.sight = RecordedSight()
        self.sight.searched = self.clock.now()
        self.robot = Robot(
            base_part=self.base,
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
