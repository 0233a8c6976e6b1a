"""Leaves that move the arm."""

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

    def initialise(self) -> None:
        self._playing = None

    def update(self) -> Status:
        if self._playing is None:
            problem = self._prepare()
            if problem:
                return self.fail(problem)
        playing = self._playing
        if playing is None:
            return self.wait("waiting for the arm to report")
        time = self.run.now() - self._begun
        self.robot.arm.move(playing.at(time + AHEAD))
        if time < playing.duration:
            return self.wait(f"{self.gesture.name}: {time:.1f} of {playing.duration:.1f} s")
        late = self._late(playing.at(playing.duration))
        if not late:
            return SUCCESS
        if time > playing.duration + PATIENCE:
            return self.fail(f"{self.gesture.name}: {', '.join(late)} did not arrive")
        return self.wait(f"{self.gesture.name}: waiting for {', '.join(late)}")

    def terminate(self, new_status: Status) -> None:
        if new_status is not SUCCESS:
            self.robot.arm.hold()

    _begun = 0.0

    def _prepare(self) -> str:
        """Check the whole gesture, and lay it out from where the joints are now; return what is wrong with it."""
        limits = self.robot.arm.limits
        for frame in self.gesture.keyframes:
            for joint, angle in frame.positions.items():
                if joint not in limits:
                    return f"gesture '{self.gesture.name}' moves joint '{joint}', which the arm lacks"
                if not limits[joint].lower - 1e-6 <= angle <= limits[joint].upper + 1e-6:
                    span = f"{limits[joint].lower:.2f} to {limits[joint].upper:.2f}"
                    return f"gesture '{self.gesture.name}': {joint} at {angle:.2f} rad is outside its limits ({span})"
        joints = {joint for frame in self.gesture.keyframes for joint in frame.positions}
        states = self.robot.arm.states()
        start = {joint: states[joint].value for joint in joints}
        if all(state is not None for state in start.values()):
            positions = {joint: state.position for joint, state in start.items() if state is not None}
            speeds = {joint: limits[joint].speed for joint in joints}
            self._playing = slowed(positions, self.gesture.keyframes, speeds, pace=self.speed)
            self._begun = self.run.now()
        return ""

    def _late(self, goals: Mapping[str, float]) -> list[str]:
        states = self.robot.arm.states()
        found = []
        for joint, goal in goals.items():
            state = states[joint].value
            if state is None or abs(state.position - goal) > ARRIVED:
                found.append(joint)
        return found
