"""An arm that takes its time: recorders over servos that turn at the speed they are told, and stop a little short."""

from collections.abc import Collection, Mapping

from py_trees.common import Status

from behaviours.leaf import RUNNING, Leaf
from behaviours.robot import Robot
from drivers.api import JointLimits, JointState, Reading
from drivers.clock import ManualClock
from drivers.sim.servo import Shaft
from missions.plugins.testing.recorders import LeafTestBench, RecordedJoints, none

TICK = 0.05

SHORT = 0.03
"""Radians that a loaded AX-12A stays short of its goal."""


class ServoArm(RecordedJoints):
    """Its joints stand at 0. Those that are ``stuck`` do not turn, those that are ``silent`` do not report."""

    def __init__(self, clock: ManualClock, limits: Mapping[str, JointLimits] | None = None) -> None:
        super().__init__(clock)
        self.limits = dict(self.limits if limits is None else limits)
        self.shafts = {joint: Shaft(0.0, 0.0, limit.speed, clock.now()) for joint, limit in self.limits.items()}
        self.short = SHORT
        self.stuck: set[str] = set()
        self.silent: set[str] = set()
        self.limp: set[str] = set()

    def move(self, goals: Mapping[str, float], *, speeds: Mapping[str, float] | None = None) -> Mapping[str, float]:
        """Turn the shafts."""
        accepted = super().move(goals, speeds=speeds)
        for joint, goal in accepted.items():
            self.limp.discard(joint)
            if joint not in self.stuck:
                shaft = self.shafts[joint]
                shaft.advance(self.clock.now())
                shaft.goal = goal - self.short
                shaft.speed = min((speeds or {}).get(joint, self.limits[joint].speed), self.limits[joint].speed)
        return accepted

    def hold(self, joints: Collection[str] | None = None) -> None:
        """Stand still."""
        super().hold(joints)
        self._stop(joints, limp=False)

    def relax(self, joints: Collection[str] | None = None) -> None:
        """Be limp."""
        super().relax(joints)
        self._stop(joints, limp=True)

    def _stop(self, joints: Collection[str] | None, *, limp: bool) -> None:
        for joint in self.limits if joints is None else joints:
            self.shafts[joint].goal = self.shafts[joint].advance(self.clock.now())
            if joint not in self.stuck:
                (self.limp.add if limp else self.limp.discard)(joint)

    def turn_by_hand(self, joint: str, angle: float) -> None:
        """Turn a limp joint."""
        shaft = self.shafts[joint]
        shaft.position = shaft.goal = angle

    def states(self) -> Mapping[str, Reading[JointState]]:
        """Measure where the shafts are now."""
        for joint, shaft in self.shafts.items():
            self.place({joint: shaft.advance(self.clock.now())}, stiff=joint not in self.limp)
        return {joint: none() if joint in self.silent else reading for joint, reading in super().states().items()}


def with_servos(
    limits: Mapping[str, JointLimits] | None = None, **groups: tuple[str, ...]
) -> tuple[LeafTestBench, ServoArm]:
    """Return a bench with such an arm, whose joints have ``groups``."""
    bench = LeafTestBench()
    servos = ServoArm(bench.clock, limits)
    bench.arm = servos
    bench.robot = Robot(arm_part=servos, groups=groups)
    return bench, servos


def play(bench: LeafTestBench, leaf: Leaf, *, limit: float = 20.0) -> float:
    """Tick until it ends; return the seconds that this took."""
    begun = bench.clock.now()
    while bench.tick(leaf, after=TICK) is RUNNING:
        assert bench.clock.now() - begun < limit
    return bench.clock.now() - begun


def tick(bench: LeafTestBench, leaf: Leaf, seconds: float) -> Status:
    """Tick for so long, or until it ends."""
    for _ in range(round(seconds / TICK)):
        if bench.tick(leaf, after=TICK) is not RUNNING:
            break
    return leaf.status


def moves(arm: RecordedJoints) -> list[Mapping[str, float]]:
    """Return the goals that it was given."""
    return [command for command in arm.commands if isinstance(command, Mapping)]
