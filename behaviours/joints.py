"""Leaves that move joints to angles or switch their torque, and conditions on joints."""

import math
from abc import abstractmethod
from collections.abc import Mapping

from py_trees.common import Status

from behaviours.joint_motion import ARM_ARGUMENT, MAX_STEP_TIME, ReportWait, joints_off_goal, positions
from behaviours.joint_ranges import JointRanges, degrees_text
from behaviours.leaf import IDLE, SUCCESS, Leaf, argument
from drivers.api import Angle, Duration, JointState

# Questions about joints: whether one is there, is hot, has to push hard, or moves.


class JointAt(Leaf):
    """Check whether a joint is at an angle.

    Succeeds if the newest measurement is within `tolerance`, fails if not. It answers at once, and is suspended while
    the joint does not report.
    """

    tag = "joint_at"
    example = "- joint_at: {joint: elbow, angle: 30 deg}"
    needs = frozenset({"arm"})
    instant = True
    output_doc = "the angle of the joint in radians"
    output_type = Angle
    joint: str = argument("joint", "name of the joint")
    angle: float = argument("angle", "expected angle")
    tolerance: float = argument("angle", "maximum difference", default=math.radians(3), low=0.0)
    on: str = ARM_ARGUMENT

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.limit_violations([{self.joint: self.angle}])

    def update(self) -> Status:
        if joint_violations := self.joint_violations(self.robot.joint_ranges):
            return self.fail("; ".join(joint_violations))
        at = positions(self.robot.arm).get(self.joint)
        if at is None:
            return self.suspend(f"joint {self.joint}")
        self.feedback_message = f"{self.joint} is at {degrees_text(at)}"
        if abs(at - self.angle) > self.tolerance:
            return self.fail(self.feedback_message)
        self.result = at
        return SUCCESS


class _AnyJoint(Leaf):
    """Base class of conditions that succeed if one of several joints fulfils them."""

    needs = frozenset({"arm"})
    instant = True
    output_doc = "the joints that fulfil the condition, as a list"
    output_type = list[str]
    joints: tuple[str, ...]
    on: str = ARM_ARGUMENT

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.unknown_names(self.joints)

    @abstractmethod
    def holds(self, state: JointState) -> bool:
        """Return True if a joint in this state fulfils the condition."""

    @abstractmethod
    def rank(self, state: JointState) -> float:
        """Return how close a joint is to fulfilling the condition; a failure names the closest joint."""

    @abstractmethod
    def state_text(self, state: JointState) -> str:
        """Return the measurement on which the condition depends as text, such as a temperature."""

    def update(self) -> Status:
        states, names = self.robot.arm.states(), self.robot.joint_ranges.resolve(self.joints)
        readings = {name: states[name].value for name in names if states[name].good}
        known_states = {name: state for name, state in readings.items() if state is not None}
        found = [name for name, state in known_states.items() if self.holds(state)]
        if found:
            self.feedback_message = ", ".join(f"{name} {self.state_text(known_states[name])}" for name in found)
            self.result = found
            return SUCCESS
        if silent := [name for name in names if name not in known_states]:
            return self.suspend(f"joint {silent[0]}")
        most = max(known_states, key=lambda name: self.rank(known_states[name]))
        return self.fail(f"{most} {self.state_text(known_states[most])}")


class JointHot(_AnyJoint):
    """Check whether a joint is hot.

    Succeeds if one of `joints` is hotter than `over`, fails if none is. It answers at once.
    """

    tag = "joint_hot"
    example = "- joint_hot: {over: 55 degC}"
    joints: tuple[str, ...] = argument("joints", "joints to check; all by default", default=(), principal=True)
    over: float = argument("temperature", "temperature above which a joint is hot", default=60.0, low=0.0, high=150.0)

    def holds(self, state: JointState) -> bool:
        return state.temperature > self.over

    def rank(self, state: JointState) -> float:
        return state.temperature

    def state_text(self, state: JointState) -> str:
        return f"has {state.temperature:.0f} degC"


class JointLoaded(_AnyJoint):
    """Check whether a joint carries a high load, in either direction.

    Succeeds if the load of one of `joints` exceeds `over`, fails if none does. It answers at once.
    """

    tag = "joint_loaded"
    example = "- joint_loaded: {joints: elbow, over: 40 %}"
    joints: tuple[str, ...] = argument("joints", "joints to check; all by default", default=(), principal=True)
    over: float = argument("share", "load, as a share of the maximum torque", default=0.5, low=0.0, high=1.0)

    def holds(self, state: JointState) -> bool:
        return abs(state.load) > self.over

    def rank(self, state: JointState) -> float:
        return abs(state.load)

    def state_text(self, state: JointState) -> str:
        return f"is loaded to {abs(state.load):.0%}"


class JointMoving(_AnyJoint):
    """Check whether a joint is moving.

    Succeeds if one of `joints` is on its way to a goal, fails if none is. It answers at once.
    """

    tag = "joint_moving"
    example = "- joint_moving: elbow"
    joints: tuple[str, ...] = argument("joints", "joints to check; all by default", default=(), principal=True)

    def holds(self, state: JointState) -> bool:
        return state.moving

    def rank(self, state: JointState) -> float:
        return abs(state.velocity)

    def state_text(self, state: JointState) -> str:
        return "moves" if state.moving else "stands still"


CONFIRMATION_TIMEOUT = 2.0
"""Seconds within which joints must report the new torque state.

It is enough to read even slowly polled registers several times.
"""

RESEND_INTERVAL = 0.5
"""Seconds after which a torque command is sent again, since a servo loses it when it is disconnected for a moment."""


class MoveJoints(Leaf):
    """Move joints to angles, all at the same time.

    Running until each joint has been measured at its angle, then succeeds. Fails before anything moves if the arm lacks
    a joint, or if an angle or the speed exceeds a limit. Fails later if a joint has not arrived in time, and says how
    far it is off.
    """

    tag = "move_joints"
    example = "- move_joints: {to: {elbow: 30 deg}, speed: 40 deg/s}"
    needs = frozenset({"arm"})
    drives = frozenset({"arm"})
    output_doc = "the duration in seconds"
    output_type = Duration
    to: Mapping[str, float] = argument("angle", "goal of each joint", by_joint=True)
    speed: float | None = argument(
        "turn rate", "speed; by default each joint's limit in the robot file", default=None, low=math.radians(1)
    )
    tolerance: float = argument(
        "angle", "difference from the goal that counts as arrived", default=math.radians(3), low=math.radians(0.2)
    )
    patience: float = argument("duration", "extra time beyond the expected duration", default=3.0, low=0.1)
    on: str = ARM_ARGUMENT
    _goals: Mapping[str, float] | None = None
    _limit = 0.0  # how long it may take
    _time = 0.0  # that it has been at it; lost connections and pauses do not count
    _seen_at = 0.0
    _begun_at = 0.0
    _wait: ReportWait

    def joint_violations(self, reach: JointRanges) -> list[str]:
        speeds = {} if self.speed is None else dict.fromkeys(self.to, self.speed)
        return [*reach.limit_violations([self.to]), *reach.speed_violations(speeds)]

    def initialise(self) -> None:
        self._goals = None
        self._wait = ReportWait()

    def update(self) -> Status:
        if self._goals is None:
            if joint_violations := self.joint_violations(self.robot.joint_ranges):
                return self.fail("; ".join(joint_violations))
            start = positions(self.robot.arm)
            if silent := [joint for joint in self.to if joint not in start]:
                if trouble := self._wait.timeout_reason(self.robot.arm, silent, self.run.now()):
                    return self.fail(trouble)
                return self.wait(f"waiting for {', '.join(sorted(silent))} to report")
            ways = (abs(goal - start[joint]) / self._speed(joint) for joint, goal in self.to.items())
            self._limit = self.patience + max(ways, default=0.0)
            self._begun_at = self._seen_at = self.run.now()
            self._time = 0.0
        now = self.run.now()
        self._time += min(now - self._seen_at, MAX_STEP_TIME)
        self._seen_at = now
        # Said at every tick: a joint that was gone for a moment has forgotten where to go.
        self._goals = self.robot.arm.move(self.to, speeds={joint: self._speed(joint) for joint in self.to})
        late = joints_off_goal(self.robot.arm, self._goals, self.tolerance)
        if not late:
            self.result = now - self._begun_at
            return SUCCESS
        if self._time > self._limit:
            return self.fail(", ".join(self._shortfall_text(joint) for joint in late))
        return self.wait(f"waiting for {', '.join(late)}")

    def _speed(self, joint: str) -> float:
        return self.robot.arm.limits[joint].speed if self.speed is None else self.speed

    def _shortfall_text(self, joint: str) -> str:
        at, goal = positions(self.robot.arm).get(joint), self.to[joint]
        detail = self.robot.arm.health().detail
        suffix = f" ({detail})" if joint in detail else ""
        if at is None:
            return f"{joint} does not report{suffix}"
        return f"{joint} stopped {degrees_text(abs(goal - at))} short of {degrees_text(goal)}{suffix}"

    def on_pause(self) -> None:
        if self._goals is not None:
            self.robot.arm.hold(tuple(self.to))

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS and self._goals is not None:
            self.robot.arm.hold(tuple(self.to))


class Torque(Leaf):
    """Switch the torque of joints: `torque: on` holds them in place, `torque: off` makes them limp.

    Running until all joints report the new state, then succeeds. Fails if one does not; the others keep the new state.
    If it is halted before, the joints are held.
    """

    tag = "torque"
    example = "- torque: off"
    needs = frozenset({"arm"})
    drives = frozenset({"arm"})
    stiff: bool = argument("flag", "on to hold, off for limp", principal=True)
    joints: tuple[str, ...] = argument("joints", "joints to switch; all by default", default=())
    on: str = ARM_ARGUMENT
    _names: tuple[str, ...] = ()
    _begun_at: float | None = None  # None while there is nobody to ask
    _sent_at = 0.0

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.unknown_names(self.joints)

    def initialise(self) -> None:
        self._names, self._begun_at = self.robot.joint_ranges.resolve(self.joints), None

    def update(self) -> Status:
        arm, now = self.robot.arm, self.run.now()
        health = arm.health()
        if not health.online:
            self._begun_at = None
            return self.wait(f"waiting: {health.detail}")
        if self._begun_at is None or now - self._sent_at >= RESEND_INTERVAL:
            self._begun_at, self._sent_at = now if self._begun_at is None else self._begun_at, now
            (arm.hold if self.stiff else arm.relax)(self._names)
        states = arm.states()
        wrong = [
            joint
            for joint in self._names
            if (state := states[joint].value) is None or not states[joint].good or state.torque is not self.stiff
        ]
        if not wrong:
            return SUCCESS
        target = "stiff" if self.stiff else "limp"
        if now - self._begun_at > CONFIRMATION_TIMEOUT:
            return self.fail(f"{', '.join(wrong)} did not become {target}")
        return self.wait(f"waiting for {', '.join(wrong)} to be {target}")

    def on_pause(self) -> None:
        pass  # nothing moves, and a joint that was made limp is not to stiffen in a hand

    def terminate(self, new_status: Status) -> None:
        # Where one did not become limp, the others are not to fight the hands that are on them.
        if self._names and (new_status is IDLE or (self.stiff and new_status is not SUCCESS)):
            self.robot.arm.hold(self._names)
