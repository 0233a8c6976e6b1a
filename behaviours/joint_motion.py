"""Base class of leaves that move joints along a path, with limited steps, and the measurement of the tracking error."""

import math
from abc import abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from math import inf
from typing import Protocol

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Angle, Coupling, Duration, JointLimits, Joints, JointState, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.joints import ActiveCouplings

# How well joints followed a motion: where each should have been, where it was measured, and how far it was off.


@dataclass(frozen=True, slots=True)
class JointSample:
    """Planned and measured position of a joint (radians), ``time`` seconds after the motion began."""

    time: float
    joint: str
    goal: float
    position: float

    @property
    def error(self) -> float:
        """Measured minus planned position in radians."""
        return self.position - self.goal


@dataclass(frozen=True, slots=True)
class JointError:
    """Tracking error of a joint over a whole motion, in radians: root mean square ``rms`` and maximum ``worst``.

    ``at`` is the time of the maximum in seconds after the motion began; ``readings`` is the number of measurements.
    """

    rms: Angle
    worst: Angle
    at: Duration
    readings: int


class TrackingErrors:
    """Collects the samples of one motion, in the order in which they arrive."""

    def __init__(self) -> None:
        self.samples: list[JointSample] = []
        self._newest: dict[str, float] = {}

    def add(self, samples: Iterable[JointSample]) -> None:
        """Add samples. A sample that is not newer than the last one of its joint is ignored."""
        for sample in samples:
            if sample.time > self._newest.get(sample.joint, -math.inf):
                self._newest[sample.joint] = sample.time
                self.samples.append(sample)

    def errors(self) -> Mapping[str, JointError]:
        """Return the error of each joint; joints without a measurement are left out."""
        by_joint: dict[str, list[JointSample]] = {}
        for sample in self.samples:
            by_joint.setdefault(sample.joint, []).append(sample)
        return {joint: _error(samples) for joint, samples in by_joint.items()}


def _error(samples: Sequence[JointSample]) -> JointError:
    worst = max(samples, key=lambda sample: abs(sample.error))
    rms = math.sqrt(math.fsum(sample.error**2 for sample in samples) / len(samples))
    return JointError(rms, abs(worst.error), worst.time, len(samples))


MIN_SPEED = 0.1
"""Minimum speed of a joint in rad/s: a small servo under load does not move evenly below it."""


def has_range(limits: JointLimits) -> bool:
    """Return True if a joint can move: its upper limit is above its lower limit."""
    return limits.upper > limits.lower


def range_coupling(leader: str, leader_limits: JointLimits, follower: str, follower_limits: JointLimits) -> Coupling:
    """Return the coupling by which the whole range of the joint ``leader`` maps onto the range of ``follower``.

    The leader's limits must span a range (see ``has_range``).
    """
    scale = (follower_limits.upper - follower_limits.lower) / (leader_limits.upper - leader_limits.lower)
    return Coupling(leader, follower, scale, follower_limits.lower - scale * leader_limits.lower)


class JointMirror:
    """Sends the joints of ``follower`` to the positions of ``leader``, as ``couplings`` say.

    Followers approach slowly at first, and after a pause. If a leader's position is unknown, its followers come to
    rest. If ``step`` is called only a few times a second, set ``time`` (s) to the interval, so that the motion is even;
    with 0, each move is at full speed. For one thread.
    """

    def __init__(self, leader: Joints, follower: Joints, couplings: Sequence[Coupling], *, time: float = 0.0) -> None:
        self._leader = leader
        self._follower = follower
        self._time = time
        self._following = ActiveCouplings(couplings)

    def step(self, now: float) -> Mapping[str, float]:
        """Send goals to the followers and return them (radians). Raises NotConnected, DeviceFault."""
        goals = self._following.goals(_known_positions(self._leader))
        if not goals:
            return {}
        limits, at = self._follower.limits, _known_positions(self._follower)
        goals = {joint: limits[joint].clamp(goal) for joint, goal in goals.items()}
        speeds = self._following.speeds(goals, at, now)
        if self._time:
            ways = {joint: abs(goal - at.get(joint, inf)) / self._time for joint, goal in goals.items()}
            even = {joint: max(speed, MIN_SPEED) for joint, speed in ways.items()}
            speeds = {joint: min(speeds.get(joint, inf), even[joint], limits[joint].speed) for joint in goals}
        return self._follower.move(goals, speeds=speeds)

    def pause(self) -> None:
        """Note that the follower was disconnected: its joints approach slowly again."""
        self._following.mark_paused()


def _known_positions(arm: Joints) -> dict[str, float]:
    """Return the positions (radians) of the joints with a good reading."""
    states = arm.states().items()
    return {joint: state.value.position for joint, state in states if state.good and state.value is not None}


GOAL_LEAD_TIME = 0.05
"""Seconds by which the goals sent to joints are ahead of the planned path: one tick and the delay of the servo bus."""

MAX_STEP_TIME = 0.1
"""Maximum seconds that one tick advances a path, so that joints do not jump after a late tick, pause or disconnect."""

RUN_IN_SPEED = math.radians(50)
"""Maximum joint speed in rad/s on the way to the first pose of a movement."""

CATCH_UP_TIME = 0.2
"""Seconds within which a joint that lags behind is to catch up with its planned path."""

SPEED_MARGIN = 1.1
"""Ratio of the speed that a joint is permitted to the speed of its planned path, so that the joint keeps up."""

REPORT_TIMEOUT = 3.0
"""Seconds to wait for joints that do not report on a connected arm; a servo restarts in one second."""


class ReportWait:
    """Timeout for joints that do not report although their arm is connected, for example because a servo has no power.

    Time does not count while the arm is disconnected.
    """

    def __init__(self) -> None:
        self._waited_seconds = 0.0
        self._seen_at: float | None = None

    def timeout_reason(self, arm: Joints, silent: Collection[str], now: float) -> str:
        """Return the reason and a hint if ``silent`` joints have not reported in time, else an empty text."""
        health = arm.health()
        if not health.online:
            self._waited_seconds, self._seen_at = 0.0, None
            return ""
        if self._seen_at is not None:
            self._waited_seconds += min(now - self._seen_at, MAX_STEP_TIME)
        self._seen_at = now
        if self._waited_seconds < REPORT_TIMEOUT:
            return ""
        hint = f"; try: {health.hint}" if health.hint else ""
        return f"{', '.join(sorted(silent))} cannot be moved: {health.detail or 'it does not report'}{hint}"


ARM_ARGUMENT: str = argument("arm", "which arm, of a robot that has several", default="arm")
"""Argument ``on`` of leaves that move or read joints."""


class JointPath(Protocol):
    """Path of joints: their planned positions at any time."""

    def at(self, time: float) -> Mapping[str, float]:
        """Return the positions (radians) at ``time`` seconds after the start."""
        ...


class JointMotion(Leaf):
    """Base class of leaves that move joints along a path from their present positions, and hold them when halted.

    Subclasses implement ``moved_joints``, ``path`` and ``follow``.
    """

    needs = frozenset({"arm"})
    drives = frozenset({"arm"})
    _path: JointPath | None = None
    _time = 0.0  # on the path
    _moved_at = 0.0
    _even_since = 0.0  # since when the path's time goes as the run's
    _wait: ReportWait

    def initialise(self) -> None:
        self._path = None
        self._wait = ReportWait()

    @abstractmethod
    def moved_joints(self) -> tuple[str, ...]:
        """Return the joints that the leaf moves."""

    @abstractmethod
    def path(self, start: Mapping[str, float]) -> JointPath:
        """Return the path from the present positions ``start`` (radians)."""

    @abstractmethod
    def follow(self, time: float, samples: Mapping[str, JointSample]) -> Status:
        """Return the status ``time`` seconds after the start; ``samples`` are the new measurements by joint."""

    def update(self) -> Status:
        if self._path is None:
            if joint_violations := self.joint_violations(self.robot.joint_ranges):
                return self.fail("; ".join(joint_violations))
            start, joints = positions(self.robot.arm), self.moved_joints()
            if silent := [joint for joint in joints if joint not in start]:
                if trouble := self._wait.timeout_reason(self.robot.arm, silent, self.run.now()):
                    return self.fail(trouble)
                return self.wait(f"waiting for {', '.join(sorted(silent))} to report")
            self._path = self.path({joint: start[joint] for joint in joints})
            self._time, self._moved_at = 0.0, self.run.now()
            self._even_since = self._moved_at
        return self._send_goals(self._path)

    def _send_goals(self, path: JointPath) -> Status:
        """Send the goals for the next tick and return the status."""
        now = self.run.now()
        passed = now - self._moved_at
        if passed > MAX_STEP_TIME:
            self._even_since = now
        time = self._time + min(passed, MAX_STEP_TIME)
        samples = self._new_samples(path, time, now)
        goals, here = path.at(time + GOAL_LEAD_TIME), path.at(time)
        limits = self.robot.arm.limits
        speeds = {}
        for joint, goal in goals.items():
            lag = -samples[joint].error if joint in samples else 0.0
            speed = abs((goal - here[joint]) / GOAL_LEAD_TIME + lag / CATCH_UP_TIME) * SPEED_MARGIN
            speeds[joint] = min(max(speed, MIN_SPEED), limits[joint].speed)
        self.robot.arm.move(goals, speeds=speeds)
        self._time, self._moved_at = time, now
        return self.follow(time, samples)

    def _new_samples(self, path: JointPath, time: float, now: float) -> dict[str, JointSample]:
        """Return the newest readings with the planned position at the time of each measurement."""
        samples = {}
        planned: dict[float, Mapping[str, float]] = {}  # most readings were taken at the same time
        states = self.robot.arm.states()
        for joint in path.at(time):
            stamp, position = states[joint].stamp, _position(states[joint])
            if position is None or stamp < self._even_since:
                continue
            then = time - (now - stamp)
            if stamp not in planned:
                planned[stamp] = path.at(then)
            samples[joint] = JointSample(then, joint, planned[stamp][joint], position)
        return samples

    def on_pause(self) -> None:
        if self._path is not None:
            self.robot.arm.hold(self.moved_joints())

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS and self._path is not None:
            self.robot.arm.hold(self.moved_joints())


def positions(arm: Joints) -> dict[str, float]:
    """Return the known positions of the joints in radians."""
    found = {joint: _position(state) for joint, state in arm.states().items()}
    return {joint: position for joint, position in found.items() if position is not None}


def joints_off_goal(arm: Joints, goals: Mapping[str, float], tolerance: float) -> list[str]:
    """Return the joints that are not, or not known to be, within ``tolerance`` (radians) of their goals."""
    at = positions(arm)
    return [joint for joint, goal in goals.items() if abs(at.get(joint, math.inf) - goal) > tolerance]


def _position(state: Reading[JointState]) -> float | None:
    return state.value.position if state.good and state.value is not None else None
