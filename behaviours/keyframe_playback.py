"""Keyframes as smooth motion, joint by joint, within the joints' speeds, and what plays them."""

import math
from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Protocol

from py_trees.common import Status

from behaviours.joint_motion import (
    ARM_ARGUMENT,
    RUN_IN_SPEED,
    JointError,
    JointMotion,
    JointSample,
    TrackingErrors,
    joints_off_goal,
)
from behaviours.joint_ranges import JointRanges
from behaviours.leaf import IDLE, SUCCESS, Leaf, argument, log
from drivers.api import Gesture as Movement
from drivers.api import Interpolation, JointState, Keyframe, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.errors import BadRequest

PEAK_SPEED_FACTORS: Mapping[Interpolation, float] = {"minimum_jerk": 1.875, "cubic": 1.5, "linear": 1.0}
"""How much faster than its mean a motion between two keyframes is at its fastest: minimum-jerk (Flash and Hogan, 1985);
a monotone cubic whose slopes at both ends are no steeper than its mean, that is between zero slopes."""

JointValues = Mapping[str, float]
"""Joints and their angles (radians), or how fast these change (rad/s)."""


@dataclass(frozen=True, slots=True)
class KeyframeMotion:
    """A laid-out motion: times in seconds, and the positions of every joint at each of them (radians).

    ``slopes`` are the joints' speeds (rad/s) at each time of a cubic motion.
    """

    times: tuple[float, ...]
    positions: tuple[JointValues, ...]
    slopes: tuple[JointValues, ...] = ()
    interpolation: Interpolation = "minimum_jerk"

    @property
    def duration(self) -> float:
        """Seconds from the start to the last keyframe."""
        return self.times[-1]

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that it moves."""
        return tuple(self.positions[0])

    def at(self, time: float) -> JointValues:
        """Return the joints' positions at ``time``; before the start and after the end, the first and the last."""
        if time <= self.times[0]:
            return self.positions[0]
        if time >= self.times[-1]:
            return self.positions[-1]
        later = bisect_right(self.times, time)
        begin, long = self.times[later - 1], self.times[later] - self.times[later - 1]
        share = (time - begin) / long
        here, there = self.positions[later - 1], self.positions[later]
        if self.interpolation != "cubic":
            share = share if self.interpolation == "linear" else _minimum_jerk(share)
            return {joint: here[joint] + share * (there[joint] - here[joint]) for joint in here}
        leaving, coming = self.slopes[later - 1], self.slopes[later]
        way, out, into = _hermite(share)
        return {
            joint: here[joint]
            + way * (there[joint] - here[joint])
            + long * (out * leaving[joint] + into * coming[joint])
            for joint in here
        }


def lay_out(
    start: JointValues,
    keyframes: Sequence[Keyframe],
    speeds: Mapping[str, float],
    *,
    pace: float = 1.0,
    interpolation: Interpolation = "minimum_jerk",
    run_in: float = math.inf,
) -> KeyframeMotion:
    """Lay out ``keyframes`` from ``start``, each segment long enough for the joints' ``speeds`` (rad/s).

    A joint that a keyframe does not name stays where the one before had it. ``pace`` divides all times. On the way from
    the start to the first keyframe, where it comes to rest in any case, no joint goes faster than ``run_in`` (rad/s).
    """
    times, positions = [0.0], [dict(start)]
    before, cap = 0.0, run_in
    for frame in keyframes:
        goal = positions[-1] | dict(frame.positions)
        ways = {joint: abs(goal[joint] - positions[-1][joint]) for joint in goal}
        needed = max(
            (PEAK_SPEED_FACTORS[interpolation] * way / min(speeds[joint], cap) for joint, way in ways.items()),
            default=0.0,
        )
        times.append(times[-1] + max((frame.time - before) / pace, needed))
        positions.append(goal)
        before, cap = frame.time, math.inf
    slopes = _slopes(times, positions) if interpolation == "cubic" else ()
    return KeyframeMotion(tuple(times), tuple(positions), slopes, interpolation)


def _slopes(times: Sequence[float], positions: Sequence[JointValues]) -> tuple[JointValues, ...]:
    """Return how fast each joint is to go at each time: at rest at the start, at the first keyframe and in the end.

    Between, it is the harmonic mean of the speeds before and behind, and zero where the joint turns back: so nothing
    overshoots a keyframe (Fritsch and Butland, 1984).
    """
    rest = dict.fromkeys(positions[0], 0.0)
    means = [
        {joint: (there[joint] - here[joint]) / (end - begin) if end > begin else 0.0 for joint in rest}
        for begin, end, here, there in zip(times, times[1:], positions, positions[1:], strict=False)
    ]
    between = [
        {joint: _harmonic(before[joint], behind[joint]) for joint in rest} for before, behind in pairwise(means[1:])
    ]
    return tuple([rest] * min(2, len(times)) + between + [rest] * (len(times) > 2))


def _harmonic(one: float, other: float) -> float:
    return 2 * one * other / (one + other) if one * other > 0 else 0.0


def _minimum_jerk(share: float) -> float:
    """Return how far along a minimum-jerk motion is after ``share`` of its time, both 0..1."""
    return share**3 * (10 - 15 * share + 6 * share**2)


def _hermite(share: float) -> tuple[float, float, float]:
    """Return what the way, and the slopes at its beginning and end, count after ``share`` (0..1) of a cubic's time."""
    left = 1 - share
    return share**2 * (3 - 2 * share), share * left**2, -(share**2) * left


ARRIVAL_TOLERANCE = 0.06
"""Radians from the last keyframe within which a joint has arrived: an AX-12A under load stays a few ticks short."""

ARRIVAL_TIMEOUT = 1.5
"""Seconds after the last keyframe that the joints have to arrive."""


class PlaybackLeaf(JointMotion):
    """Plays a movement, at ``speed`` times its own; to its first pose no joint goes faster than ``run_in`` (rad/s)."""

    speed: float
    run_in = math.inf
    _duration = 0.0
    _end: Mapping[str, float]

    @property
    @abstractmethod
    def movement(self) -> Movement:
        """What is played."""

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.limit_violations(frame.positions for frame in self.movement.keyframes)

    def moved_joints(self) -> tuple[str, ...]:
        # In the order of the movement: a set would have its own in every process.
        return tuple(dict.fromkeys(joint for frame in self.movement.keyframes for joint in frame.positions))

    def path(self, start: Mapping[str, float]) -> KeyframeMotion:
        speeds = {joint: limits.speed for joint, limits in self.robot.arm.limits.items()}
        playing = lay_out(
            start,
            self.movement.keyframes,
            speeds,
            pace=self.speed,
            interpolation=self.movement.interpolation,
            run_in=self.run_in,
        )
        self._duration, self._end = playing.duration, playing.positions[-1]
        return playing

    def follow(self, time: float, samples: Mapping[str, JointSample]) -> Status:
        del samples
        name = self.movement.name
        if time < self._duration:
            return self.wait(f"{name}: {time:.1f} of {self._duration:.1f} s")
        late = joints_off_goal(self.robot.arm, self._end, ARRIVAL_TOLERANCE)
        if not late:
            return SUCCESS
        if time > self._duration + ARRIVAL_TIMEOUT:
            return self.fail(f"{name}: {', '.join(late)} did not arrive")
        return self.wait(f"{name}: waiting for {', '.join(late)}")


# The leaf that plays a gesture.


class GestureLeaf(PlaybackLeaf):
    """Play a gesture with the arm.

    Running until the last keyframe is reached, then succeeds. A gesture that the joints cannot follow is slowed down.
    Fails before anything moves when the arm lacks a joint or a keyframe lies outside its limits, and in the end when a
    joint did not arrive.
    """

    tag = "gesture"
    gesture: Movement = argument("gesture", "which one", principal=True)
    speed: float = argument("number", "1 plays it as recorded, 0.5 at half the speed", default=1.0, low=0.1, high=2.0)
    on: str = ARM_ARGUMENT

    @property
    def movement(self) -> Movement:
        return self.gesture


# Leaves that play recorded movements and record them.


class Play(PlaybackLeaf):
    """Play a movement that was recorded, or that a spreadsheet holds.

    Running while it comes to the first pose, slowly, and then until the last one is reached, then succeeds. A movement
    that the joints cannot follow is slowed down. Fails before anything moves when the arm lacks a joint or a pose lies
    outside its limits, and in the end when a joint did not arrive.
    """

    tag = "play"
    output_doc = "how well it was followed, by joint: rms, worst (radians), at (seconds), readings"
    output_type = Mapping[str, JointError]
    move: Movement = argument("move", "which one: a name, or a file: .yaml, .csv, .xls, .xlsx or .ods", principal=True)
    speed: float = argument("number", "1 plays it as recorded, 0.5 at half the speed", default=1.0, low=0.05, high=2.0)
    on: str = ARM_ARGUMENT
    run_in = RUN_IN_SPEED
    tracking: TrackingErrors
    _begins_at = 0.0

    @property
    def movement(self) -> Movement:
        return self.move

    def path(self, start: Mapping[str, float]) -> KeyframeMotion:
        playing = super().path(start)
        self.tracking, self._begins_at = TrackingErrors(), playing.times[1]
        return playing

    def follow(self, time: float, samples: Mapping[str, JointSample]) -> Status:
        self.tracking.add(each for each in samples.values() if self._begins_at <= each.time <= self._duration)
        status = super().follow(time, samples)
        if status is SUCCESS:
            self.result = self.tracking.errors()
        return status


class MoveRecording(Protocol):
    """A movement while it is made."""

    @property
    def seconds(self) -> float:
        """How long it is by now."""
        ...

    def add(self, states: Mapping[str, Reading[JointState]], now: float) -> None:
        """Take the newest readings. Raises drivers.errors.NoReply once they have stayed away for too long."""
        ...

    def write(self) -> None:
        """Write it to its file. Raises drivers.errors.BadRequest where that cannot be, or nothing has moved."""
        ...


class MoveDestination(Protocol):
    """A file that a movement is recorded into, by the name that the mission gives it."""

    @property
    def path(self) -> Path:
        """Where it will be."""
        ...

    def begin(self, joints: Sequence[str]) -> MoveRecording:
        """Return an empty recording of these joints."""
        ...


class RecordMove(Leaf):
    """Record what joints do, to be played again, into a file that must not be there yet.

    Running until it is halted, or for that long; then the file is written. It drives nothing: let `torque: off` make
    the joints limp before, to be moved by hand, or another behaviour move them meanwhile. Fails when the file is there
    already or cannot be written, when joints fall silent, and when nothing has moved.
    """

    tag = "record_move"
    needs = frozenset({"arm"})
    output_doc = "the path of the file"
    output_type = str
    move: MoveDestination = argument(
        "new move", "a name, for NAME.yaml in the current folder, or a path", principal=True
    )
    joints: tuple[str, ...] = argument("joints", "which; else all", default=())
    duration: float | None = argument("duration", "how long; else until it is halted", default=None, low=0.1)
    on: str = ARM_ARGUMENT
    _recording: MoveRecording

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.unknown_names(self.joints)

    def initialise(self) -> None:
        if self.move.path.exists():
            raise BadRequest(f"{self.move.path} is there already: remove it, or choose another name")
        self._recording = self.move.begin(self.robot.joint_ranges.resolve(self.joints))

    def update(self) -> Status:
        recording = self._recording
        recording.add(self.robot.arm.states(), self.run.now())
        # A duration that is a whole number of ticks is over with the last of them, in spite of rounding.
        if self.duration is None or recording.seconds < self.duration - 1e-6:
            return self.wait(f"recording for {recording.seconds:.1f} s")
        recording.write()
        self.result = str(self.move.path)
        return SUCCESS

    def terminate(self, new_status: Status) -> None:
        if new_status is not IDLE:
            return
        try:
            self._recording.write()
        except BadRequest as error:  # nobody waits for its result any more
            log.error("%s: %s", self.label, error)
