"""The leaf that moves joints to and fro between two angles: evenly, or as sines with a phase for each."""

import math
from collections.abc import Mapping

from py_trees.common import Status

from behaviours.joint_motion import ARM_ARGUMENT, RUN_IN_SPEED, JointMotion, JointSample
from behaviours.joint_ranges import JointRanges
from behaviours.keyframe_playback import KeyframeMotion, lay_out
from behaviours.leaf import argument
from drivers.api import Keyframe


class SwingPath:
    """To and fro between ``low`` and ``high`` (radians) every ``period`` seconds, from ``low`` on, after a run-in.

    ``phases`` say how far ahead of that each joint is, in radians of a full turn.
    """

    def __init__(self, low: float, high: float, period: float, phases: Mapping[str, float], *, sine: bool) -> None:
        self._low, self._way, self._period = low, high - low, period
        self._phases = phases
        self._sine = sine
        self.run_in: KeyframeMotion | None = None

    @property
    def max_speed(self) -> float:
        """The highest speed of a joint, in rad/s."""
        return (math.pi if self._sine else 2.0) * self._way / self._period

    def at(self, time: float) -> Mapping[str, float]:
        """Return where the joints are to be."""
        if self.run_in is not None:
            if time < self.run_in.duration:
                return self.run_in.at(time)
            time -= self.run_in.duration
        return {joint: self._angle(time / self._period + phase / math.tau) for joint, phase in self._phases.items()}

    def _angle(self, turns: float) -> float:
        if self._sine:
            return self._low + self._way * (1 - math.cos(math.tau * turns)) / 2
        return self._low + self._way * (1 - abs(1 - 2 * (turns % 1.0)))


class SweepLeaf(JointMotion):
    """Move joints to and fro between two angles until it is stopped: evenly, or as sines that follow one another.

    Running until it is halted; it never succeeds. It comes slowly to where it begins. Joints that cannot go that fast
    take longer. Fails before anything moves when the arm lacks a joint, or an angle lies outside its limits.
    """

    tag = "sweep"
    ends = frozenset({"failure"})
    joints: tuple[str, ...] = argument("joints", "a joint, a group of them, or a list")
    between: tuple[float, float] = argument("angle", "from where to where", span=True)
    period: float = argument("duration", "for once to and fro", default=4.0, low=0.1)
    sine: bool = argument("flag", "as a sine, instead of evenly with a turn at both ends", default=False)
    phases: Mapping[str, float] = argument(
        "angle", "how far ahead a joint is, where 360 deg is once to and fro", default={}, by_joint=True
    )
    on: str = ARM_ARGUMENT

    def joint_violations(self, reach: JointRanges) -> list[str]:
        if unknown := reach.unknown_names(self.joints):
            return unknown
        joints = reach.resolve(self.joints)
        strange = [joint for joint in self.phases if joint not in joints]
        return [
            *reach.limit_violations(dict.fromkeys(joints, end) for end in self.between),
            *(f"there is a phase for '{joint}', which is not to move" for joint in strange),
        ]

    def moved_joints(self) -> tuple[str, ...]:
        return self.robot.joint_ranges.resolve(self.joints)

    def path(self, start: Mapping[str, float]) -> SwingPath:
        speeds = {joint: self.robot.arm.limits[joint].speed for joint in start}
        phases = {joint: self.phases.get(joint, 0.0) for joint in start}
        swing = SwingPath(*self.between, self.period, phases, sine=self.sine)
        stretch = max(1.0, swing.max_speed / min(speeds.values()))
        swing = SwingPath(*self.between, self.period * stretch, phases, sine=self.sine)
        swing.run_in = lay_out(start, [Keyframe(0.0, swing.at(0.0))], speeds, run_in=RUN_IN_SPEED)
        return swing

    def follow(self, time: float, samples: Mapping[str, JointSample]) -> Status:
        del time
        shown = (f"{joint} {math.degrees(sample.position):+.0f} deg" for joint, sample in samples.items())
        return self.wait(", ".join(shown))
