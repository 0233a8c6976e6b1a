"""Leaves that swing the head: nodding, shaking, and looking back and forth."""

import math
from dataclasses import replace
from typing import ClassVar

from py_trees.common import Status

from behaviours.head import ArrivalDetector, pose_text, unmeasured_note
from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import HeadPose


class _HeadSwing(Leaf):
    """Base class of leaves that swing the head on one axis about its start pose."""

    needs = frozenset({"head"})
    drives = frozenset({"head"})
    on: str = argument("head", "head to turn, for robots with several", default="head")
    amplitude: float
    period: float
    _home: HeadPose | None = None  # where it looked before, and looks again in the end
    _since_home = 0.0
    _paused_at: float | None = None

    def initialise(self) -> None:
        self._home = self._paused_at = None

    def start_pose(self) -> HeadPose | None:
        """Return the pose of the head at the start, or None until it is known."""
        if self._home is None:
            self._home, self._since_home = self.robot.head.pose().value, self.run.now()
        elif self._paused_at is not None:
            self._since_home += self.run.now() - self._paused_at
        self._paused_at = None
        return self._home

    @property
    def swing_time(self) -> float:
        """Seconds of swinging so far, without pauses."""
        return self.run.now() - self._since_home

    def swing_range(self, home: HeadPose, axis: str) -> tuple[float, float]:
        """Return middle and amplitude of the swing on ``axis`` in radians.

        If the swing about ``home`` would exceed the head's limits, its middle is moved; if it is wider than the limits,
        its amplitude is reduced.
        """
        limits = self.robot.head.limits
        low, high = limits.pan if axis == "pan" else limits.tilt
        amplitude = min(self.amplitude, (high - low) / 2)
        middle = home.pan if axis == "pan" else home.tilt
        return min(max(middle, low + amplitude), high - amplitude), amplitude

    def turn(self, home: HeadPose, axis: str, angle: float) -> HeadPose:
        """Send a goal to the head: ``axis`` at ``angle`` (radians), and the other axis as in ``home``."""
        return self.robot.head.look(replace(home, pan=angle) if axis == "pan" else replace(home, tilt=angle))

    def on_pause(self) -> None:
        super().on_pause()
        self._paused_at = self.run.now()

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()


class _HeadGesture(_HeadSwing):
    """Base class of gestures: the head swings to one side and back, ``times`` times, then to its start pose."""

    axis: ClassVar[str] = ""
    times: int
    _arrival: ArrivalDetector
    _swing_angle = 0.0  # radians from where it looked, as measured

    def initialise(self) -> None:
        super().initialise()
        self._arrival, self._swing_angle = ArrivalDetector(), 0.0

    def on_pause(self) -> None:
        super().on_pause()
        self._arrival = ArrivalDetector()

    def _measure_swing(self, home: HeadPose) -> None:
        here = self.robot.head.pose()
        if here.good and here.value is not None:
            self._swing_angle = max(self._swing_angle, abs(getattr(here.value, self.axis) - getattr(home, self.axis)))

    def update(self) -> Status:
        start = self.start_pose()
        if start is None:
            return self.wait("the head has not reported its pose yet")
        middle, amplitude = self.swing_range(start, self.axis)
        # No head turns sooner than it can come from side to side.
        half = max(self.period / 2, self.robot.head.limits.time_for(2 * amplitude))
        turns = int(self.swing_time / half)
        self._measure_swing(start)
        if turns < 2 * self.times:
            self.turn(start, self.axis, middle + (amplitude if turns % 2 == 0 else -amplitude))
            return self.wait(f"{turns // 2 + 1} of {self.times}")
        goal, reading = self.robot.head.look(start), self.robot.head.pose()
        if self._arrival(reading, goal, self.run.now()):
            if self.robot.head.limits.measured and self._swing_angle < amplitude / 2:
                angle_text = f"{math.degrees(self._swing_angle):.1f} of {math.degrees(amplitude):.1f} deg"
                return self.fail(f"the head turned by {angle_text} only; is it blocked?")
            if note := unmeasured_note(self.robot.head):
                self.feedback_message = f"back at {pose_text(goal)}{note}"
            return SUCCESS
        if self._arrival.stuck and reading.value is not None:
            return self.fail(f"the head rests at {pose_text(reading.value)} and does not return to {pose_text(goal)}")
        return self.wait(f"back to {pose_text(goal)}")


class Nod(_HeadGesture):
    """Nod: turn the head down and up, then back to its start pose.

    Running until done, then succeeds. A slow head takes longer. Fails if the head does not turn, or does not come back.
    """

    tag = "nod"
    example = "- nod: 2"
    axis = "tilt"
    times: int = argument("count", "number of nods", default=2, principal=True, low=1, high=20)
    amplitude: float = argument(
        "angle", "angle up and down", default=math.radians(8), low=math.radians(2), high=math.radians(45)
    )
    period: float = argument("duration", "duration of one nod", default=0.8, low=0.2)


class ShakeHead(_HeadGesture):
    """Shake the head: turn it left and right, then back to its start pose.

    Running until done, then succeeds. A slow head takes longer. Fails if the head does not turn, or does not come back.
    """

    tag = "shake_head"
    example = "- shake_head: 3"
    axis = "pan"
    times: int = argument("count", "number of shakes", default=2, principal=True, low=1, high=20)
    amplitude: float = argument(
        "angle", "angle to each side", default=math.radians(15), low=math.radians(2), high=math.radians(90)
    )
    period: float = argument("duration", "duration of one shake", default=1.0, low=0.2)


class SweepHead(_HeadSwing):
    """Swing the head back and forth about its start pose, as a sine, until halted.

    Running until it is halted; it never succeeds. A slow head swings more slowly.
    """

    tag = "sweep_head"
    example = "- sweep_head: 40 deg\n  timeout: 20 s"
    ends = frozenset({"failure"})
    vertical: bool = argument("flag", "swing up and down instead of left and right", default=False)
    amplitude: float = argument(
        "angle", "angle to each side", default=math.radians(45), principal=True, low=math.radians(1), high=math.pi / 2
    )
    period: float = argument("duration", "duration of one cycle", default=8.0, low=0.5)

    def update(self) -> Status:
        start, axis = self.start_pose(), "tilt" if self.vertical else "pan"
        if start is None:
            return self.wait("the head has not reported its pose yet")
        middle, amplitude = self.swing_range(start, axis)
        limits = self.robot.head.limits
        # The steepest and the sharpest point of a sine are amplitude * w and amplitude * w**2.
        fastest = min(limits.speed / amplitude, math.sqrt(limits.acceleration / amplitude))
        rate = min(2 * math.pi / self.period, fastest)
        self.turn(start, axis, middle + amplitude * math.sin(rate * self.swing_time))
        here = self.robot.head.pose().value
        return self.wait("" if here is None else f"at {pose_text(here)}")
