"""Leaves for legs beside walking: to stand, to sit, to get up, and to play a gait by name."""

import math
from collections.abc import Mapping
from typing import ClassVar

from py_trees.common import Status

from behaviours.driving.motion import held_up
from behaviours.joint_motion import RUN_IN
from behaviours.joint_ranges import JointRanges
from behaviours.leaf import SUCCESS, argument
from behaviours.playing import Played
from behaviours.tracking_error import Sample
from behaviours.walking import LAST_STEPS, Paces
from drivers.api import FALLEN, BaseState, Pose2D, Posture
from drivers.api import Gesture as Movement
from drivers.api.gait import GaitKeys

ON_ITS_SIDE = math.radians(30)
"""How little the trunk is pitched when it lies on its side."""

ACT_TIME = 20.0
"""Seconds that a stand or a sit can take."""

CYCLE = 2.0
"""Seconds of a cycle of a gait that does not say how long it is."""

UPRIGHT_WITHIN = 2.0
"""Seconds after the last pose of a movement by which it is up, or it has failed."""


class Act(Paces):
    """Lets the legs perform an ``act``."""

    act: ClassVar[str]

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        del state, start
        return ACT_TIME

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del state, start
        done = self.robot.base.perform(self.act)
        return SUCCESS if done >= 1.0 else self.wait(f"{100 * done:.0f} %")

    def halting(self) -> bool:
        return False  # legs on their way to a stand or a sit stay where they are


class Stand(Act):
    """Stand: bring the legs to where a walk begins, slowly, from upright, from a sit, or from between.

    Running until it stands, then succeeds, and stays stiff. Fails for legs that are elsewhere, as of one that lies or
    sits on a chair, when it has fallen, for a base without legs, and while that is stopped. Halted, it stays as it is.
    """

    word = "stand"
    act = "stand"


class Sit(Act):
    """Sit down on its heels, slowly, with its weight over the soles all the way; `stride.sit` says how low.

    Running until it sits, then succeeds, and stays stiff. It fails, and is halted, as `stand`.
    """

    word = "sit"
    act = "sit"


class PlayGait(Paces):
    """Play a gait of `config/gaits`, or of a file: the cycle of its joints over and over, without balance.

    It stands first; the gait grows out of the stand within a cycle, and shrinks back into it within another. Running
    until it has played so many cycles and stands again, then succeeds. Halted, it ends in a stand too. Fails for a gait
    that its legs cannot do, with the joint and the time, and as `stand`.
    """

    word = "play_gait"
    stores = "how many cycles it has played"
    keeps = float
    gait: GaitKeys = argument("gait", "which: a name, or a file (.yaml)", principal=True)
    cycles: int | None = argument("count", "how many; else until it is halted", default=None, low=1)
    _begun = False

    def initialise(self) -> None:
        super().initialise()
        self._begun = False

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float | None:
        del state, start
        return None if self.cycles is None else (self.cycles + 2) * (self.gait.period or CYCLE) + ACT_TIME

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        if self._stopping:
            return self.wait("coming to a stand") if state.posture is Posture.MOVING else SUCCESS
        done = self.result = self.robot.base.perform("gait", self.gait)
        # The last cycle is the one in which it comes to a stand.
        if self.cycles is not None and done >= max(self.cycles - 1, 1):
            self.result = float(self.cycles)
            self._stopping = True
            self.robot.base.stop()
        return self.wait(f"{self.gait.gait}: {done:.1f} cycles")

    def halting(self) -> bool:
        reading = self.robot.base.state()
        return reading.good and reading.value is not None and reading.value.posture is Posture.MOVING


class GetUp(Played):
    """Get up by a movement of its joints, after a fall: by `front` when it lies on its face, `back` on its back.

    Running until it has played it and is upright, then succeeds, and its base takes commands again. Fails when it has
    not fallen, when it lies on its side or in a way for which it was given no movement, when it is not upright in the
    end, and while somebody has stopped it. Halted, its joints are held as they are.
    """

    word = "get_up"
    needs = frozenset({"arm", "base", "imu"})
    drives = frozenset({"arm", "base"})
    halt_limit = LAST_STEPS
    run_in = RUN_IN
    front: Movement | None = argument("move", "the movement from its face: a name, or a file", default=None)
    back: Movement | None = argument("move", "the movement from its back: a name, or a file", default=None)
    speed: float = argument("number", "1 plays it as recorded, 0.5 at half the speed", default=1.0, low=0.05, high=2.0)
    _chosen: Movement | None = None

    @property
    def movement(self) -> Movement:
        if self._chosen is None:
            raise RuntimeError("get_up: nothing was chosen yet")  # update does, before anything moves
        return self._chosen

    def joint_violations(self, reach: JointRanges) -> list[str]:
        known = [move for move in (self.front, self.back) if move is not None]
        return reach.beyond(frame.positions for move in known for frame in move.keyframes)

    def initialise(self) -> None:
        super().initialise()
        self._chosen = None

    def update(self) -> Status:
        if self._chosen is None:
            base = self.robot.base
            if base.latched and base.latched != FALLEN:
                return self.fail(held_up(base))
            reading, attitude = base.state(), self.robot.imu.attitude()
            if not (reading.good and attitude.good and reading.value is not None and attitude.value is not None):
                return self.wait("waiting for the base and the IMU to report")
            if not reading.value.fallen:
                return self.fail("it has not fallen")
            if abs(attitude.value.pitch) < ON_ITS_SIDE:
                return self.fail("it lies on its side: nothing is known for that")
            word, where = ("front", "face") if attitude.value.pitch > 0 else ("back", "back")
            self._chosen = self.front if word == "front" else self.back
            if self._chosen is None:
                return self.fail(f"it lies on its {where}, and knows no movement from there: give `{word}`")
        return super().update()

    def follow(self, time: float, samples: Mapping[str, Sample]) -> Status:
        if time < self._duration:
            return super().follow(time, samples)
        base = self.robot.base  # whether it is up counts, not where each joint of a leg on the floor came to rest
        state = base.state().value
        if state is None or state.fallen:
            late = time > self._duration + UPRIGHT_WITHIN
            return self.fail("it did not get up") if late else self.wait("getting upright")
        if base.latched == FALLEN:
            base.enable()
        return SUCCESS
