"""Smooth motion through keyframes within the joints' speed limits, and the leaves that play and record movements."""

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
"""Ratio of peak to mean speed between two keyframes, for each interpolation.

minimum_jerk: Flash and Hogan, 1985. cubic: a monotone cubic whose end slopes are at most its mean slope; the ratio is
that for end slopes of zero, the largest one.
"""

JointValues = Mapping[str, float]
"""Angles (radians) or speeds (rad/s) by joint."""


@dataclass(frozen=True, slots=True)
class KeyframeMotion:
    """Motion through keyframes: ``times`` in seconds, and ``positions`` of all joints (radians) at each time.

    ``slopes`` are the joint speeds (rad/s) at each time of a cubic motion.
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
        """Joints that the motion moves."""
        return tuple(self.positions[0])

    def at(self, time: float) -> JointValues:
        """Return the joint positions (radians) at ``time``, clamped to the first and the last keyframe."""
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
    """Return the motion from ``start`` through ``keyframes``, slowed down where joints are too slow for it.

    ``speeds`` are the maximum joint speeds (rad/s). A joint that a keyframe does not name keeps its position. ``pace``
    is the playback speed: 2 halves all times. The joints come to rest at the first keyframe, and no joint moves faster
    than ``run_in`` (rad/s) on the way there.
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
    """Return the speed of each joint at each time: zero at the start, at the first keyframe and at the end.

    In between it is the harmonic mean of the mean speeds before and after, and zero where the joint reverses. So no
    joint overshoots a keyframe (Fritsch and Butland, 1984).
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
    """Return how much of the distance (0..1) a minimum-jerk motion has covered.

    ``share`` (0..1) is the share of its time that has passed.
    """
    return share**3 * (10 - 15 * share + 6 * share**2)


def _hermite(share: float) -> tuple[float, float, float]:
    """Return the factors of distance, start slope and end slope of a cubic Hermite curve.

    ``share`` (0..1) is the share of the curve's time that has passed.
    """
    left = 1 - share
    return share**2 * (3 - 2 * share), share * left**2, -(share**2) * left


ARRIVAL_TOLERANCE = 0.06
"""Radians from the last keyframe within which a joint has arrived: a loaded AX-12A stays a few ticks short."""

ARRIVAL_TIMEOUT = 1.5
"""Seconds after the last keyframe within which the joints must arrive."""


class PlaybackLeaf(JointMotion):
    """Base class of leaves that play a movement at ``speed`` times its recorded speed.

    No joint moves faster than ``run_in`` (rad/s) to the first pose.
    """

    speed: float
    run_in = math.inf
    _duration = 0.0
    _end: Mapping[str, float]

    @property
    @abstractmethod
    def movement(self) -> Movement:
        """Movement (keyframes of joint angles) that the leaf plays."""

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

    Running until the last keyframe is reached, then succeeds. A gesture that is too fast for the joints is slowed down.
    Fails before anything moves if the arm lacks a joint or a keyframe exceeds its limits. Fails in the end if a joint
    has not arrived.
    """

    tag = "gesture"
    example = "- gesture: hello"
    gesture: Movement = argument("gesture", "gesture: a name, or a file", principal=True)
    speed: float = argument(
        "number", "factor of the recorded speed; 0.5 is half the speed", default=1.0, low=0.1, high=2.0
    )
    on: str = ARM_ARGUMENT

    @property
    def movement(self) -> Movement:
        return self.gesture


# Leaves that play recorded movements and record them.


class Play(PlaybackLeaf):
    """Play a movement from a recording or a spreadsheet.

    Running on the slow way to the first pose and until the last pose is reached, then succeeds. A movement that is too
    fast for the joints is slowed down. Fails before anything moves if the arm lacks a joint or a pose exceeds its
    limits. Fails in the end if a joint has not arrived.
    """

    tag = "play"
    example = "- play: {move: hello, speed: 0.5}"
    output_doc = "the tracking error by joint: rms, worst (radians), at (seconds), readings"
    output_type = Mapping[str, JointError]
    move: Movement = argument("move", "movement: a name, or a file (.yaml, .csv, .xls, .xlsx or .ods)", principal=True)
    speed: float = argument(
        "number", "factor of the recorded speed; 0.5 is half the speed", default=1.0, low=0.05, high=2.0
    )
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
    """Recording in progress of a movement of joints."""

    @property
    def seconds(self) -> float:
        """Length so far in seconds."""
        ...

    def add(self, states: Mapping[str, Reading[JointState]], now: float) -> None:
        """Add the newest readings of the joints. Raises drivers.errors.NoReply if readings are missing for too long."""
        ...

    def write(self) -> None:
        """Write the file. Raises drivers.errors.BadRequest if that fails, or if nothing has moved."""
        ...


class MoveDestination(Protocol):
    """New file into which a movement can be recorded."""

    @property
    def path(self) -> Path:
        """Path of the file."""
        ...

    def begin(self, joints: Sequence[str]) -> MoveRecording:
        """Return an empty recording of the motion of ``joints``."""
        ...


class RecordMove(Leaf):
    """Record the motion of joints into a new file, to play it later.

    Running until it is halted, or for `duration`; then the file is written. It moves nothing: make the joints limp with
    `torque: off` before, to move them by hand, or let another behaviour move them. Fails if the file exists or cannot
    be written, if joints stop reporting, and if nothing has moved.
    """

    tag = "record_move"
    example = "- record_move: {move: my_wave, duration: 10 s}"
    acts = True
    needs = frozenset({"arm"})
    output_doc = "the path of the file"
    output_type = str
    move: MoveDestination = argument("new move", "name, for NAME.yaml in the current folder, or a path", principal=True)
    joints: tuple[str, ...] = argument("joints", "joints to record; all by default", default=())
    duration: float | None = argument(
        "duration", "length of the recording; records until halted by default", default=None, low=0.1
    )
    on: str = ARM_ARGUMENT
    _recording: MoveRecording

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.unknown_names(self.joints)

    def initialise(self) -> None:
        if self.move.path.exists():
            raise BadRequest(f"{self.move.path} already exists: remove it, or choose another name")
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
