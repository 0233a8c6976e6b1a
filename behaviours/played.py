"""What the leaves that play a movement have in common, be it a gesture or a recording."""

import math
from abc import abstractmethod
from collections.abc import Mapping

from py_trees.common import Status

from behaviours.joint_motion import JointMotion, off
from behaviours.joint_ranges import JointRanges
from behaviours.leaf import SUCCESS
from behaviours.playing import Playing, slowed
from behaviours.tracking_error import Sample
from drivers.api import Gesture as Movement

ARRIVED = 0.06
"""Radians from the last keyframe within which a joint has arrived: an AX-12A under load stays a few ticks short."""

ARRIVAL_TIMEOUT = 1.5
"""Seconds after the last keyframe that the joints have to arrive."""


class Played(JointMotion):
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
        return reach.beyond(frame.positions for frame in self.movement.keyframes)

    def moved(self) -> tuple[str, ...]:
        # In the order of the movement: a set would have its own in every process.
        return tuple(dict.fromkeys(joint for frame in self.movement.keyframes for joint in frame.positions))

    def path(self, start: Mapping[str, float]) -> Playing:
        speeds = {joint: limits.speed for joint, limits in self.robot.arm.limits.items()}
        playing = slowed(
            start,
            self.movement.keyframes,
            speeds,
            pace=self.speed,
            interpolation=self.movement.interpolation,
            run_in=self.run_in,
        )
        self._duration, self._end = playing.duration, playing.positions[-1]
        return playing

    def follow(self, time: float, samples: Mapping[str, Sample]) -> Status:
        del samples
        name = self.movement.name
        if time < self._duration:
            return self.wait(f"{name}: {time:.1f} of {self._duration:.1f} s")
        late = off(self.robot.arm, self._end, ARRIVED)
        if not late:
            return SUCCESS
        if time > self._duration + ARRIVAL_TIMEOUT:
            return self.fail(f"{name}: {', '.join(late)} did not arrive")
        return self.wait(f"{name}: waiting for {', '.join(late)}")
