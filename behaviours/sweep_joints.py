"""Leaf that moves joints back and forth between two angles, linearly or as sines with a phase per joint."""

import math
from collections.abc import Mapping

from py_trees.common import Status

from behaviours.joint_motion import ARM_ARGUMENT, RUN_IN_SPEED, JointMotion, JointSample
from behaviours.joint_ranges import JointRanges
from behaviours.keyframe_playback import KeyframeMotion, lay_out
from behaviours.leaf import argument
from drivers.api import Keyframe


class SwingPath:
    """Motion of joints between ``low`` and ``high`` (radians) with a ``period`` in seconds.

    It begins at ``low``, after a slow approach to that position. ``phases`` are the lead of each joint in radians of a
    full cycle.
    """

    def __init__(self, low: float, high: float, period: float, phases: Mapping[str, float], *, sine: bool) -> None:
        self._low, self._way, self._period = low, high - low, period
        self._phases = phases
        self._sine = sine
        self.run_in: KeyframeMotion | None = None

    @property
    def max_speed(self) -> float:
        """Highest speed of a joint in rad/s."""
        return (math.pi if self._sine else 2.0) * self._way / self._period

    def at(self, time: float) -> Mapping[str, float]:
        """Return the positions (radians) at ``time`` seconds after the start."""
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
    """Move joints back and forth between two angles until halted, linearly or as phase-shifted sines.

    Running until it is halted; it never succeeds. The joints approach the first pose slowly. If they are too slow for
    the period, the period is longer. Fails before anything moves if the arm lacks a joint or an angle exceeds its
    limits.
    """

    tag = "sweep"
    example = "- sweep: {joints: elbow, between: [-20 deg, 20 deg], period: 3 s}\n  timeout: 12 s"
    ends = frozenset({"failure"})
    joints: tuple[str, ...] = argument("joints", "a joint, a group, or a list")
    between: tuple[float, float] = argument("angle", "the two angles", span=True)
    period: float = argument("duration", "duration of one cycle", default=4.0, low=0.1)
    sine: bool = argument("flag", "move as a sine, instead of linearly", default=False)
    phases: Mapping[str, float] = argument(
        "angle", "lead of single joints; 360 deg is one cycle", default={}, by_joint=True
    )
    on: str = ARM_ARGUMENT

    def joint_violations(self, reach: JointRanges) -> list[str]:
        if unknown := reach.unknown_names(self.joints):
            return unknown
        joints = reach.resolve(self.joints)
        strange = [joint for joint in self.phases if joint not in joints]
        return [
            *reach.limit_violations(dict.fromkeys(joints, end) for end in self.between),
            *(f"there is a phase for '{joint}', which does not move" for joint in strange),
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
        texts = (f"{joint} {math.degrees(sample.position):+.0f} deg" for joint, sample in samples.items())
        return self.wait(", ".join(texts))
