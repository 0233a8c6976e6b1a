"""Leaves for legs beside walking: to stand, to sit, to get up, and to play a gait by name."""

import math
from collections.abc import Mapping
from typing import ClassVar

from py_trees.common import Status

from behaviours.base_conditions import BaseCondition
from behaviours.driving.motion import BaseMotion, MotionDirection, distance_along, latch_reason
from behaviours.joint_motion import RUN_IN_SPEED, JointSample
from behaviours.joint_ranges import JointRanges
from behaviours.keyframe_playback import PlaybackLeaf
from behaviours.leaf import SUCCESS, argument
from drivers.api import FALLEN_REASON, ZERO_VELOCITY, Angle, BaseState, Length, Pose2D, Posture, Steering, Velocity
from drivers.api import Gesture as Movement
from drivers.api.gait import GaitKeys

# Leaves for a base that walks: so far, so long, round on the spot; and whether it has fallen.

APPROACH_TIME = 1.0
"""Seconds that what is left takes at the speed of the approach: steps cannot be shorter than they are."""

STOP_DELAY = 0.25
"""Seconds of its present speed that a walk still goes on for after it was told to stop, on average."""

MIN_WALK_SPEED, MIN_TURN_RATE = 0.03, math.radians(2)
"""How slowly (m/s, rad/s) a walk comes to its goal."""

STAND_TIMEOUT = 4.0
"""Seconds that a walk has to come to a stand."""

READY_TIMEOUT = 15.0
"""Seconds in which the legs come to a stand before a walk begins."""


class WalkMotion(BaseMotion):
    """Walks towards a goal, and ends in a stand; halted, it still makes the steps by which it comes to one."""

    halt_limit = STAND_TIMEOUT

    def approach_speed(self, left: float, speed: float, now: float, *, slowest: float) -> float:
        """Return how fast to go with ``left`` to go, at ``speed`` at most; 0 when it is time to stop."""
        if self._stopping or left <= STOP_DELAY * abs(now) / 2:
            return 0.0
        return min(speed, max(slowest, left / APPROACH_TIME))

    def halting(self) -> bool:
        reading = self.robot.base.state()
        return reading.good and reading.value is not None and reading.value.velocity != ZERO_VELOCITY

    def stop_reason(self, state: BaseState, steering: Steering) -> str:
        return "it has fallen" if state.fallen else super().stop_reason(state, steering)


def seconds_to_walk(distance: float, speed: float, limit: float) -> float:
    """Return how long a walk (m) or turn (rad) by steps can take: it stands up before, and comes to a stand."""
    return abs(distance) / max(min(abs(speed), limit), 1e-6) + READY_TIMEOUT + STAND_TIMEOUT


class WalkLeaf(WalkMotion):
    """Walk: so far, or on and on.

    With a distance, running until the steps have covered it and it stands, then succeeds; negative is backwards.
    Without one, it walks until it is halted. Halted, it comes to a stand within two steps. Fails when it has fallen,
    when it bumps into something where the base feels that, and while the base is stopped until somebody enables it.
    """

    tag = "walk"
    output_doc = "how far it went, by its steps (m; negative backwards)"
    output_type = Length
    distance: float | None = argument("length", "how far; else until it is halted", default=None, principal=True)
    velocity: float = argument("speed", "how fast; without a distance, negative is backwards", default=0.15)
    turn: float = argument("turn rate", "how fast it turns on the way; positive is to the left", default=0.0)
    _at: Pose2D | None = None
    _distance_gone = 0.0
    _distance_before = 0.0  # when its clock began

    def initialise(self) -> None:
        super().initialise()
        self._at, self._distance_gone, self._distance_before = None, 0.0, 0.0

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        self._at = None  # what a person drives is not of this walk
        self._distance_before = self._distance_gone

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float | None:
        del state, start
        if self.distance is None:
            return None
        left = abs(self.distance) - abs(self._distance_before)
        return seconds_to_walk(left, self.velocity, self.robot.base.limits.speed)

    @property
    def motion_direction(self) -> MotionDirection:
        return (
            MotionDirection.AHEAD
            if (self.velocity if self.distance is None else self.distance) > 0.0
            else MotionDirection.BACK
        )

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        if self._at is not None:  # piece by piece, for it may be a curve
            self._distance_gone += distance_along(self._at, state.pose)
        self._at = state.pose
        gone = self.result = self._distance_gone
        if self.distance is not None and self.velocity == 0.0:
            return self.fail("with a velocity of 0 it gets nowhere")
        if self.distance is None:
            return self.steer(Velocity(self.velocity, self.turn), f"{gone:.2f} m")
        way = math.copysign(1.0, self.distance)
        left = (self.distance - gone) * way
        speed = self.approach_speed(left, abs(self.velocity), state.velocity.linear, slowest=MIN_WALK_SPEED)
        if speed == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        return self.steer(Velocity(way * speed, self.turn), f"{gone:.2f} of {self.distance:.2f} m")


class TurnInPlace(WalkMotion):
    """Turn on the spot by steps: to the left for a positive angle.

    Running until the steps have turned it so far and it stands, then succeeds. Fails as `walk` does.
    """

    tag = "turn_in_place"
    output_doc = "how far it turned, by its steps (rad)"
    output_type = Angle
    angle: float = argument("angle", "how far; positive is to the left", principal=True)
    speed: float = argument("turn rate", "how fast", default=math.radians(30), low=math.radians(1), high=math.pi)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        left = self.angle - (state.pose.heading - start.heading)
        return seconds_to_walk(left, self.speed, self.robot.base.limits.turn)

    @property
    def motion_direction(self) -> MotionDirection:
        return MotionDirection.ROUND

    def go(self, state: BaseState, start: Pose2D) -> Status:
        turned = self.result = state.pose.heading - start.heading
        way = math.copysign(1.0, self.angle)
        left = (self.angle - turned) * way
        speed = self.approach_speed(left, self.speed, state.velocity.angular, slowest=MIN_TURN_RATE)
        if speed == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        doing = f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.steer(Velocity(0.0, way * speed), doing)


class Fallen(BaseCondition):
    """Has it fallen?

    Succeeds while the base leans too far to be standing, or is about to; without an IMU, while its legs bear nothing
    though they should. Fails when not, and where nothing measures that. It never runs.
    """

    tag = "fallen"

    def judge(self, state: BaseState) -> Status:
        if state.lean is None and state.fallen:
            self.feedback_message = "its legs bear nothing"
            return SUCCESS
        if state.lean is None:
            return self.fail("nothing measures how it stands")
        self.feedback_message = f"it leans by {math.degrees(state.lean):.0f} deg"
        return SUCCESS if state.fallen else self.fail(self.feedback_message)


MAX_SIDE_PITCH = math.radians(30)
"""How little the trunk is pitched when it lies on its side."""

ACT_TIME_LIMIT = 20.0
"""Seconds that a stand or a sit can take."""

DEFAULT_CYCLE_TIME = 2.0
"""Seconds of a cycle of a gait that does not say how long it is."""

UPRIGHT_TIMEOUT = 2.0
"""Seconds after the last pose of a movement by which it is up, or it has failed."""


class LegActLeaf(WalkMotion):
    """Lets the legs perform an ``act``."""

    needs = frozenset({"base", "legs"})
    act: ClassVar[str]

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        del state, start
        return ACT_TIME_LIMIT

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del state, start
        done = self.robot.legs.perform(self.act)
        return SUCCESS if done >= 1.0 else self.wait(f"{100 * done:.0f} %")

    def halting(self) -> bool:
        return False  # legs on their way to a stand or a sit stay where they are


class Stand(LegActLeaf):
    """Stand: bring the legs to where a walk begins, slowly, from upright, from a sit, or from between.

    Running until it stands, then succeeds, and stays stiff. Fails for legs that are elsewhere, as of one that lies or
    sits on a chair, when it has fallen, for a base without legs, and while that is stopped. Halted, it stays as it is.
    """

    tag = "stand"
    act = "stand"


class Sit(LegActLeaf):
    """Sit down on its heels, slowly, with its weight over the soles all the way; `stride.sit` says how low.

    Running until it sits, then succeeds, and stays stiff. It fails, and is halted, as `stand`.
    """

    tag = "sit"
    act = "sit"


class PlayGait(WalkMotion):
    """Play a gait of `config/gaits`, or of a file: the cycle of its joints over and over, without balance.

    It stands first; the gait grows out of the stand within a cycle, and shrinks back into it within another. Running
    until it has played so many cycles and stands again, then succeeds. Halted, it ends in a stand too. Fails for a gait
    that its legs cannot do, with the joint and the time, and as `stand`.
    """

    tag = "play_gait"
    needs = frozenset({"base", "legs"})
    output_doc = "how many cycles it has played"
    output_type = float
    gait: GaitKeys = argument("gait", "which: a name, or a file (.yaml)", principal=True)
    cycles: int | None = argument("count", "how many; else until it is halted", default=None, low=1)
    _begun = False

    def initialise(self) -> None:
        super().initialise()
        self._begun = False

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float | None:
        del state, start
        return (
            None
            if self.cycles is None
            else (self.cycles + 2) * (self.gait.period or DEFAULT_CYCLE_TIME) + ACT_TIME_LIMIT
        )

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        if self._stopping:
            return self.wait("coming to a stand") if state.posture is Posture.MOVING else SUCCESS
        done = self.result = self.robot.legs.perform("gait", self.gait)
        # The last cycle is the one in which it comes to a stand.
        if self.cycles is not None and done >= max(self.cycles - 1, 1):
            self.result = float(self.cycles)
            self._stopping = True
            self.robot.base.stop()
        return self.wait(f"{self.gait.gait}: {done:.1f} cycles")

    def halting(self) -> bool:
        reading = self.robot.base.state()
        return reading.good and reading.value is not None and reading.value.posture is Posture.MOVING


class GetUp(PlaybackLeaf):
    """Get up by a movement of its joints, after a fall: by `front` when it lies on its face, `back` on its back.

    Running until it has played it and is upright, then succeeds, and its base takes commands again. Fails when it has
    not fallen, when it lies on its side or in a way for which it was given no movement, when it is not upright in the
    end, and while somebody has stopped it. Halted, its joints are held as they are.
    """

    tag = "get_up"
    needs = frozenset({"arm", "base", "imu"})
    drives = frozenset({"arm", "base"})
    halt_limit = STAND_TIMEOUT
    run_in = RUN_IN_SPEED
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
        return reach.limit_violations(frame.positions for move in known for frame in move.keyframes)

    def initialise(self) -> None:
        super().initialise()
        self._chosen = None

    def update(self) -> Status:
        if self._chosen is None:
            base = self.robot.base
            if base.latched and base.latched != FALLEN_REASON:
                return self.fail(latch_reason(base))
            reading, attitude = base.state(), self.robot.imu.attitude()
            if not (reading.good and attitude.good and reading.value is not None and attitude.value is not None):
                return self.wait("waiting for the base and the IMU to report")
            if not reading.value.fallen:
                return self.fail("it has not fallen")
            if abs(attitude.value.pitch) < MAX_SIDE_PITCH:
                return self.fail("it lies on its side: nothing is known for that")
            word, where = ("front", "face") if attitude.value.pitch > 0 else ("back", "back")
            self._chosen = self.front if word == "front" else self.back
            if self._chosen is None:
                return self.fail(f"it lies on its {where}, and knows no movement from there: give `{word}`")
        return super().update()

    def follow(self, time: float, samples: Mapping[str, JointSample]) -> Status:
        if time < self._duration:
            return super().follow(time, samples)
        base = self.robot.base  # whether it is up counts, not where each joint of a leg on the floor came to rest
        state = base.state().value
        if state is None or state.fallen:
            late = time > self._duration + UPRIGHT_TIMEOUT
            return self.fail("it did not get up") if late else self.wait("getting upright")
        if base.latched == FALLEN_REASON:
            base.enable()
        return SUCCESS
