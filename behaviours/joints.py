"""Leaves that order joints about: to angles, to be stiff, to be limp."""

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
    """Is a joint at an angle?

    Succeeds when it was measured there lately, fails when not. It never runs; suspended while the joint does not
    report.
    """

    tag = "joint_at"
    needs = frozenset({"arm"})
    instant = True
    output_doc = "where the joint is, in radians"
    output_type = Angle
    joint: str = argument("joint", "which one")
    angle: float = argument("angle", "where")
    tolerance: float = argument("angle", "how near is there", default=math.radians(3), low=0.0)
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
    """Asks several joints something, and succeeds when it is so for one of them."""

    needs = frozenset({"arm"})
    instant = True
    output_doc = "the joints of which it is so, as a list"
    output_type = list[str]
    joints: tuple[str, ...]
    on: str = ARM_ARGUMENT

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.unknown_names(self.joints)

    @abstractmethod
    def holds(self, state: JointState) -> bool:
        """Say whether it is so for a joint that feels this."""

    @abstractmethod
    def rank(self, state: JointState) -> float:
        """Return how near it is to being so: the nearest joint is told of where it is so for none."""

    @abstractmethod
    def state_text(self, state: JointState) -> str:
        """Say what was asked of a joint that feels this."""

    def update(self) -> Status:
        states, names = self.robot.arm.states(), self.robot.joint_ranges.resolve(self.joints)
        known = {name: states[name].value for name in names if states[name].good}
        felt = {name: state for name, state in known.items() if state is not None}
        found = [name for name, state in felt.items() if self.holds(state)]
        if found:
            self.feedback_message = ", ".join(f"{name} {self.state_text(felt[name])}" for name in found)
            self.result = found
            return SUCCESS
        if silent := [name for name in names if name not in felt]:
            return self.suspend(f"joint {silent[0]}")
        most = max(felt, key=lambda name: self.rank(felt[name]))
        return self.fail(f"{most} {self.state_text(felt[most])}")


class JointHot(_AnyJoint):
    """Is a joint hot?

    Succeeds when one of them, or of all, is hotter than that, fails when none is. It never runs.
    """

    tag = "joint_hot"
    joints: tuple[str, ...] = argument("joints", "which; else all", default=(), principal=True)
    over: float = argument("temperature", "from where on it is hot", default=60.0, low=0.0, high=150.0)

    def holds(self, state: JointState) -> bool:
        return state.temperature > self.over

    def rank(self, state: JointState) -> float:
        return state.temperature

    def state_text(self, state: JointState) -> str:
        return f"has {state.temperature:.0f} degC"


class JointLoaded(_AnyJoint):
    """Does a joint have to push hard, either way?

    Succeeds when one of them, or of all, is loaded more than that, fails when none is. It never runs.
    """

    tag = "joint_loaded"
    joints: tuple[str, ...] = argument("joints", "which; else all", default=(), principal=True)
    over: float = argument("share", "from which part of its greatest torque on", default=0.5, low=0.0, high=1.0)

    def holds(self, state: JointState) -> bool:
        return abs(state.load) > self.over

    def rank(self, state: JointState) -> float:
        return abs(state.load)

    def state_text(self, state: JointState) -> str:
        return f"is loaded to {abs(state.load):.0%}"


class JointMoving(_AnyJoint):
    """Does a joint move?

    Succeeds when one of them, or of all, is on its way to a goal, fails when none is. It never runs.
    """

    tag = "joint_moving"
    joints: tuple[str, ...] = argument("joints", "which; else all", default=(), principal=True)

    def holds(self, state: JointState) -> bool:
        return state.moving

    def rank(self, state: JointState) -> float:
        return abs(state.velocity)

    def state_text(self, state: JointState) -> str:
        return "moves" if state.moving else "stands still"


CONFIRMATION_TIMEOUT = 2.0
"""Seconds within which joints report that they are stiff or limp: several rounds, even of the slow registers."""

RESEND_INTERVAL = 0.5
"""Seconds after which an order is given again: a servo that was gone for a moment has forgotten it."""


class MoveJoints(Leaf):
    """Move joints to angles, all at once.

    Running until each has been measured at its angle, then succeeds. Fails before anything moves when the arm lacks a
    joint, or one is asked to go too far or too fast; and when a joint has not arrived, with how far it is off.
    """

    tag = "move_joints"
    needs = frozenset({"arm"})
    drives = frozenset({"arm"})
    output_doc = "how long it took, in seconds"
    output_type = Duration
    to: Mapping[str, float] = argument("angle", "where each joint is to go", by_joint=True)
    speed: float | None = argument(
        "turn rate", "how fast; else each as fast as the robot file allows", default=None, low=math.radians(1)
    )
    tolerance: float = argument("angle", "how near is there", default=math.radians(3), low=math.radians(0.2))
    patience: float = argument("duration", "how much longer than the way should take it may take", default=3.0, low=0.1)
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
        """Say how far a joint is from where it was to go."""
        at, goal = positions(self.robot.arm).get(joint), self.to[joint]
        detail = self.robot.arm.health().detail
        why = f" ({detail})" if joint in detail else ""
        if at is None:
            return f"{joint} does not report{why}"
        return f"{joint} stopped {degrees_text(abs(goal - at))} short of {degrees_text(goal)}{why}"

    def on_pause(self) -> None:
        if self._goals is not None:
            self.robot.arm.hold(tuple(self.to))

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS and self._goals is not None:
            self.robot.arm.hold(tuple(self.to))


class Torque(Leaf):
    """Make joints stiff where they stand (`torque: on`), or limp, to be moved by hand (`torque: off`).

    Running until all report that they are, then succeeds. Fails when one does not; the others stay as they were told.
    Halted before, they are held.
    """

    tag = "torque"
    needs = frozenset({"arm"})
    drives = frozenset({"arm"})
    stiff: bool = argument("flag", "on, or off for limp", principal=True)
    joints: tuple[str, ...] = argument("joints", "which; else all", default=())
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
        wanted = "stiff" if self.stiff else "limp"
        if now - self._begun_at > CONFIRMATION_TIMEOUT:
            return self.fail(f"{', '.join(wrong)} did not become {wanted}")
        return self.wait(f"waiting for {', '.join(wrong)} to be {wanted}")

    def on_pause(self) -> None:
        pass  # nothing moves, and a joint that was made limp is not to stiffen in a hand

    def terminate(self, new_status: Status) -> None:
        # Where one did not become limp, the others are not to fight the hands that are on them.
        if self._names and (new_status is IDLE or (self.stiff and new_status is not SUCCESS)):
            self.robot.arm.hold(self._names)
