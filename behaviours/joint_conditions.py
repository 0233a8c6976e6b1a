"""Questions about joints: whether one is there, is hot, has to push hard, or moves."""

import math
from abc import abstractmethod

from py_trees.common import Status

from behaviours.joint_motion import ON_ARM, positions
from behaviours.joint_ranges import JointRanges, degrees
from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import Angle, JointState


class JointAt(Leaf):
    """Is a joint at an angle?

    Succeeds when it was measured there lately, fails when not. It never runs; suspended while the joint does not
    report.
    """

    word = "joint_at"
    needs = frozenset({"arm"})
    instant = True
    stores = "where the joint is, in radians"
    keeps = Angle
    joint: str = argument("joint", "which one")
    angle: float = argument("angle", "where")
    tolerance: float = argument("angle", "how near is there", default=math.radians(3), low=0.0)
    on: str = ON_ARM

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.beyond([{self.joint: self.angle}])

    def update(self) -> Status:
        if joint_violations := self.joint_violations(self.robot.reach):
            return self.fail("; ".join(joint_violations))
        at = positions(self.robot.arm).get(self.joint)
        if at is None:
            return self.suspend(f"joint {self.joint}")
        self.feedback_message = f"{self.joint} is at {degrees(at)}"
        if abs(at - self.angle) > self.tolerance:
            return self.fail(self.feedback_message)
        self.result = at
        return SUCCESS


class _AnyJoint(Leaf):
    """Asks several joints something, and succeeds when it is so for one of them."""

    needs = frozenset({"arm"})
    instant = True
    stores = "the joints of which it is so, as a list"
    keeps = list[str]
    joints: tuple[str, ...]
    on: str = ON_ARM

    def joint_violations(self, reach: JointRanges) -> list[str]:
        return reach.unknown(self.joints)

    @abstractmethod
    def is_so(self, state: JointState) -> bool:
        """Say whether it is so for a joint that feels this."""

    @abstractmethod
    def rank(self, state: JointState) -> float:
        """Return how near it is to being so: the nearest joint is told of where it is so for none."""

    @abstractmethod
    def shown(self, state: JointState) -> str:
        """Say what was asked of a joint that feels this."""

    def update(self) -> Status:
        states, names = self.robot.arm.states(), self.robot.reach.named(self.joints)
        known = {name: states[name].value for name in names if states[name].good}
        felt = {name: state for name, state in known.items() if state is not None}
        found = [name for name, state in felt.items() if self.is_so(state)]
        if found:
            self.feedback_message = ", ".join(f"{name} {self.shown(felt[name])}" for name in found)
            self.result = found
            return SUCCESS
        if silent := [name for name in names if name not in felt]:
            return self.suspend(f"joint {silent[0]}")
        most = max(felt, key=lambda name: self.rank(felt[name]))
        return self.fail(f"{most} {self.shown(felt[most])}")


class JointHot(_AnyJoint):
    """Is a joint hot?

    Succeeds when one of them, or of all, is hotter than that, fails when none is. It never runs.
    """

    word = "joint_hot"
    joints: tuple[str, ...] = argument("joints", "which; else all", default=(), principal=True)
    over: float = argument("temperature", "from where on it is hot", default=60.0, low=0.0, high=150.0)

    def is_so(self, state: JointState) -> bool:
        return state.temperature > self.over

    def rank(self, state: JointState) -> float:
        return state.temperature

    def shown(self, state: JointState) -> str:
        return f"has {state.temperature:.0f} degC"


class JointLoaded(_AnyJoint):
    """Does a joint have to push hard, either way?

    Succeeds when one of them, or of all, is loaded more than that, fails when none is. It never runs.
    """

    word = "joint_loaded"
    joints: tuple[str, ...] = argument("joints", "which; else all", default=(), principal=True)
    over: float = argument("share", "from which part of its greatest torque on", default=0.5, low=0.0, high=1.0)

    def is_so(self, state: JointState) -> bool:
        return abs(state.load) > self.over

    def rank(self, state: JointState) -> float:
        return abs(state.load)

    def shown(self, state: JointState) -> str:
        return f"is loaded to {abs(state.load):.0%}"


class JointMoving(_AnyJoint):
    """Does a joint move?

    Succeeds when one of them, or of all, is on its way to a goal, fails when none is. It never runs.
    """

    word = "joint_moving"
    joints: tuple[str, ...] = argument("joints", "which; else all", default=(), principal=True)

    def is_so(self, state: JointState) -> bool:
        return state.moving

    def rank(self, state: JointState) -> float:
        return abs(state.velocity)

    def shown(self, state: JointState) -> str:
        return "moves" if state.moving else "stands still"
