"""Leaves that say something with the head: yes, no, and looking to and fro."""

import math
from dataclasses import replace
from typing import ClassVar

from py_trees.common import Status

from behaviours.head import Arrival, shown, unmeasured
from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api import HeadPose


class _Swinging(Leaf):
    """What all have in common: they swing about where the head looks, along one axis."""

    needs = frozenset({"head"})
    drives = frozenset({"head"})
    on: str = argument("head", "which head it turns, of a robot that has several", default="head")
    amplitude: float
    period: float
    _home: HeadPose | None = None  # where it looked before, and looks again in the end
    _since_home = 0.0
    _paused_at: float | None = None

    def initialise(self) -> None:
        self._home = self._paused_at = None

    def home(self) -> HeadPose | None:
        """Return where the head looked when it began; None as long as that is not known."""
        if self._home is None:
            self._home, self._since_home = self.robot.head.pose().value, self.run.now()
        elif self._paused_at is not None:
            self._since_home += self.run.now() - self._paused_at
        self._paused_at = None
        return self._home

    @property
    def swinging(self) -> float:
        """Seconds since it knows where it swings about."""
        return self.run.now() - self._since_home

    def swung(self, home: HeadPose, axis: str) -> tuple[float, float]:
        """Return the middle and the amplitude of the swing, in radians: moved, then cut, to keep within the limits."""
        limits = self.robot.head.limits
        low, high = limits.pan if axis == "pan" else limits.tilt
        amplitude = min(self.amplitude, (high - low) / 2)
        middle = home.pan if axis == "pan" else home.tilt
        return min(max(middle, low + amplitude), high - amplitude), amplitude

    def turn(self, home: HeadPose, axis: str, angle: float) -> HeadPose:
        """Turn one axis to ``angle``, the other to where it was."""
        return self.robot.head.look(replace(home, pan=angle) if axis == "pan" else replace(home, tilt=angle))

    def on_pause(self) -> None:
        super().on_pause()
        self._paused_at = self.run.now()

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.head.stop()


class _Gesture(_Swinging):
    """A gesture: to one side and to the other, a few times, and back to where the head looked."""

    axis: ClassVar[str] = ""
    times: int
    _arrival: Arrival
    _swung = 0.0  # radians from where it looked, as measured

    def initialise(self) -> None:
        super().initialise()
        self._arrival, self._swung = Arrival(), 0.0

    def on_pause(self) -> None:
        super().on_pause()
        self._arrival = Arrival()

    def _note(self, home: HeadPose) -> None:
        """Note how far the head has turned."""
        here = self.robot.head.pose()
        if here.good and here.value is not None:
            self._swung = max(self._swung, abs(getattr(here.value, self.axis) - getattr(home, self.axis)))

    def update(self) -> Status:
        home = self.home()
        if home is None:
            return self.wait("where the head looks is not known yet")
        middle, amplitude = self.swung(home, self.axis)
        # No head turns sooner than it can come from side to side.
        half = max(self.period / 2, self.robot.head.limits.time_for(2 * amplitude))
        turns = int(self.swinging / half)
        self._note(home)
        if turns < 2 * self.times:
            self.turn(home, self.axis, middle + (amplitude if turns % 2 == 0 else -amplitude))
            return self.wait(f"{turns // 2 + 1} of {self.times}")
        goal, reading = self.robot.head.look(home), self.robot.head.pose()
        if self._arrival(reading, goal, self.run.now()):
            if self.robot.head.limits.measured and self._swung < amplitude / 2:
                far = f"{math.degrees(self._swung):.1f} of {math.degrees(amplitude):.1f} deg"
                return self.fail(f"the head turned by {far} only: blocked?")
            if note := unmeasured(self.robot.head):
                self.feedback_message = f"back at {shown(goal)}{note}"
            return SUCCESS
        if self._arrival.stuck and reading.value is not None:
            return self.fail(f"the head rests at {shown(reading.value)} and does not come back to {shown(goal)}")
        return self.wait(f"back to {shown(goal)}")


class Nod(_Gesture):
    """Nod: down and up, and back to where the head looked.

    Running until that is done, then succeeds. A head that cannot do it that fast takes longer. Fails when the head does
    not turn, or does not come back.
    """

    word = "nod"
    axis = "tilt"
    times: int = argument("count", "how many times", default=2, principal=True, low=1, high=20)
    amplitude: float = argument(
        "angle", "how far down and up", default=math.radians(8), low=math.radians(2), high=math.radians(45)
    )
    period: float = argument("duration", "for once down and up", default=0.8, low=0.2)


class ShakeHead(_Gesture):
    """Shake the head: left and right, and back to where it looked.

    Running until that is done, then succeeds. A head that cannot do it that fast takes longer. Fails when the head does
    not turn, or does not come back.
    """

    word = "shake_head"
    axis = "pan"
    times: int = argument("count", "how many times", default=2, principal=True, low=1, high=20)
    amplitude: float = argument(
        "angle", "how far to each side", default=math.radians(15), low=math.radians(2), high=math.radians(90)
    )
    period: float = argument("duration", "for once left and right", default=1.0, low=0.2)


class SweepHead(_Swinging):
    """Let the head swing to and fro about where it looks, as a sine, until it is stopped.

    Running until it is halted; it never succeeds. A head that cannot swing that fast swings more slowly.
    """

    word = "sweep_head"
    ends = frozenset({"failure"})
    vertical: bool = argument("flag", "up and down instead of left and right", default=False)
    amplitude: float = argument(
        "angle", "how far to each side", default=math.radians(45), principal=True, low=math.radians(1), high=math.pi / 2
    )
    period: float = argument("duration", "for once to and fro", default=8.0, low=0.5)

    def update(self) -> Status:
        home, axis = self.home(), "tilt" if self.vertical else "pan"
        if home is None:
            return self.wait("where the head looks is not known yet")
        middle, amplitude = self.swung(home, axis)
        limits = self.robot.head.limits
        # The steepest and the sharpest point of a sine are amplitude * w and amplitude * w**2.
        fastest = min(limits.speed / amplitude, math.sqrt(limits.acceleration / amplitude))
        rate = min(2 * math.pi / self.period, fastest)
        self.turn(home, axis, middle + amplitude * math.sin(rate * self.swinging))
        here = self.robot.head.pose().value
        return self.wait("" if here is None else f"at {shown(here)}")
