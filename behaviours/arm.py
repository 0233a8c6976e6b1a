"""Leaves that move the arm."""

import math
from collections.abc import Mapping

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from behaviours.playing import Playing, slowed
from drivers.api import Gesture as Movement

ARRIVED = 0.06
"""Radians from the last keyframe within which a joint has arrived: an AX-12A under load stays a few ticks short."""

PATIENCE = 1.5
"""Seconds after the last keyframe that the joints have to arrive."""

AHEAD = 0.05
"""Seconds that the goals run ahead of the time: a tick and the bus."""

LONGEST_STEP = 0.1
"""Seconds: a tick counts for no longer, so that after a late one, a pause or a lost arm nothing leaps."""


class Gesture(Leaf):
    """Play a gesture with the arm.

    Running until the last keyframe is reached, then succeeds. A gesture that the joints cannot follow is slowed down.
    Fails before anything moves when the arm lacks a joint or a keyframe lies outside its limits, and in the end when a
    joint did not arrive.
    """

    word = "gesture"
    needs = frozenset({"arm"})
    drives = frozenset({"arm"})
    gesture: Movement = argument("gesture", "which one", principal=True)
    speed: float = argument("number", "1 plays it as recorded, 0.5 at half the speed", default=1.0, low=0.1, high=2.0)
    _playing: Playing | None = None
    _time = 0.0  # of the gesture
    _moved_at = 0.0

    def initialise(self) -> None:
        self._playing = None

    def update(self) -> Status:
        playing = self._playing
        if playing is None:
            problem = self._misfit()
            if problem:
                return self.fail(problem)
            start = self._positions()
            # In the order of the gesture: a set would have its own in every process.
            joints = dict.fromkeys(joint for frame in self.gesture.keyframes for joint in frame.positions)
            if silent := joints.keys() - start.keys():
                return self.wait(f"waiting for {', '.join(sorted(silent))} to report")
            playing = self._begin({joint: start[joint] for joint in joints})
        now = self.run.now()
        time = self._time + min(now - self._moved_at, LONGEST_STEP)
        self.robot.arm.move(playing.at(time + AHEAD))
        self._time, self._moved_at = time, now
        if time < playing.duration:
            return self.wait(f"{self.gesture.name}: {time:.1f} of {playing.duration:.1f} s")
        late = self._late(playing.at(playing.duration))
        if not late:
            return SUCCESS
        if time > playing.duration + PATIENCE:
            return self.fail(f"{self.gesture.name}: {', '.join(late)} did not arrive")
        return self.wait(f"{self.gesture.name}: waiting for {', '.join(late)}")

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS and self._playing is not None:
            self.robot.arm.hold()

    def _misfit(self) -> str:
        """Check the whole gesture; return why the arm cannot play it."""
        limits = self.robot.arm.limits
        for frame in self.gesture.keyframes:
            for joint, angle in frame.positions.items():
                if joint not in limits:
                    return f"gesture '{self.gesture.name}' moves joint '{joint}', which the arm lacks"
                if not limits[joint].lower - 1e-6 <= angle <= limits[joint].upper + 1e-6:
                    span = f"{limits[joint].lower:.2f} to {limits[joint].upper:.2f}"
                    return f"gesture '{self.gesture.name}': {joint} at {angle:.2f} rad is outside its limits ({span})"
        return ""

    def _begin(self, start: Mapping[str, float]) -> Playing:
        """Lay the gesture out from where its joints are now."""
        speeds = {joint: limits.speed for joint, limits in self.robot.arm.limits.items()}
        playing = slowed(start, self.gesture.keyframes, speeds, pace=self.speed)
        self._playing, self._time, self._moved_at = playing, 0.0, self.run.now()
        return playing

    def _positions(self) -> dict[str, float]:
        """Return where the joints are now, as far as that is known."""
        states = self.robot.arm.states().items()
        return {joint: state.value.position for joint, state in states if state.good and state.value is not None}

    def _late(self, goals: Mapping[str, float]) -> list[str]:
        """Return the joints that are not, or not known to be, at their goals."""
        at = self._positions()
        return [joint for joint, goal in goals.items() if abs(at.get(joint, math.inf) - goal) > ARRIVED]
