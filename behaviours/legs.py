"""Leaves for robots with legs: walk, turn, stand, sit, get up, play a gait; and a condition for falls."""

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
"""Time constant in seconds of the approach to a goal: the speed is the remaining distance divided by it."""

STOP_DELAY = 0.25
"""Distance that a walk still covers after a stop command, on average, in seconds of its present speed."""

MIN_WALK_SPEED, MIN_TURN_RATE = 0.03, math.radians(2)
"""Minimum speed (m/s) and turn rate (rad/s) of an approach."""

STAND_TIMEOUT = 4.0
"""Seconds that a walk may take to come to a stand."""

READY_TIMEOUT = 15.0
"""Seconds that the legs may take to reach a stand before a walk begins."""


class WalkMotion(BaseMotion):
    """Base class of walks that end in a stand. A halt lets the legs finish the steps that lead to a stand."""

    halt_limit = STAND_TIMEOUT

    def approach_speed(self, left: float, speed: float, now: float, *, slowest: float) -> float:
        """Return the speed for the remaining distance ``left`` (m or rad); 0 when it is time to stop.

        It is between ``slowest`` and ``speed``; ``now`` is the present speed. All speeds are in m/s or rad/s.
        """
        if self._stopping or left <= STOP_DELAY * abs(now) / 2:
            return 0.0
        return min(speed, max(slowest, left / APPROACH_TIME))

    def halting(self) -> bool:
        reading = self.robot.base.state()
        return reading.good and reading.value is not None and reading.value.velocity != ZERO_VELOCITY

    def stop_reason(self, state: BaseState, steering: Steering) -> str:
        return "it has fallen" if state.fallen else super().stop_reason(state, steering)


def seconds_to_walk(distance: float, speed: float, limit: float) -> float:
    """Return the seconds that a walk (m) or turn (rad) may take, including the stand before and after it.

    ``speed`` is the requested speed, ``limit`` the robot's maximum speed.
    """
    return abs(distance) / max(min(abs(speed), limit), 1e-6) + READY_TIMEOUT + STAND_TIMEOUT


class WalkLeaf(WalkMotion):
    """Walk a distance, or until halted.

    With a distance, running until the steps have covered it and the robot stands, then succeeds; a negative distance is
    backwards. Without a distance, it walks until it is halted. A halt brings it to a stand within two steps. Fails
    after a fall, after a bump if the base has bumpers, and while the base is latched.
    """

    tag = "walk"
    example = "- walk: 0.5 m"
    output_doc = "the distance walked, by the steps (m; negative backwards)"
    output_type = Length
    distance: float | None = argument("length", "distance; walks until halted by default", default=None, principal=True)
    velocity: float = argument("speed", "speed; without a distance, negative is backwards", default=0.15)
    turn: float = argument("turn rate", "turn rate on the way; positive is to the left", default=0.0)
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
        walked = self.result = self._distance_gone
        if self.distance is not None and self.velocity == 0.0:
            return self.fail("the velocity is 0")
        if self.distance is None:
            return self.steer(Velocity(self.velocity, self.turn), f"{walked:.2f} m")
        direction = math.copysign(1.0, self.distance)
        remaining = (self.distance - walked) * direction
        speed = self.approach_speed(remaining, abs(self.velocity), state.velocity.linear, slowest=MIN_WALK_SPEED)
        if speed == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        return self.steer(Velocity(direction * speed, self.turn), f"{walked:.2f} of {self.distance:.2f} m")


class TurnInPlace(WalkMotion):
    """Turn on the spot by steps; a positive angle is to the left.

    Running until the steps have turned the robot by the angle and it stands, then succeeds. Fails as `walk` does.
    """

    tag = "turn_in_place"
    example = "- turn_in_place: 90 deg"
    output_doc = "the angle turned, by the steps (rad)"
    output_type = Angle
    angle: float = argument("angle", "angle; positive is to the left", principal=True)
    speed: float = argument(
        "turn rate", "maximum turn rate", default=math.radians(30), low=math.radians(1), high=math.pi
    )

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        left = self.angle - (state.pose.heading - start.heading)
        return seconds_to_walk(left, self.speed, self.robot.base.limits.turn)

    @property
    def motion_direction(self) -> MotionDirection:
        return MotionDirection.ROUND

    def go(self, state: BaseState, start: Pose2D) -> Status:
        angle = self.result = state.pose.heading - start.heading
        direction = math.copysign(1.0, self.angle)
        remaining = (self.angle - angle) * direction
        speed = self.approach_speed(remaining, self.speed, state.velocity.angular, slowest=MIN_TURN_RATE)
        if speed == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        activity = f"{math.degrees(angle):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.steer(Velocity(0.0, direction * speed), activity)


class Fallen(BaseCondition):
    """Check whether the robot has fallen.

    Succeeds while the base leans too far to stand, or is about to fall. Without an IMU, it succeeds while the legs
    carry no load although they should. Fails otherwise, and if no sensor measures either. It answers at once.
    """

    tag = "fallen"
    example = "- fallen"

    def judge(self, state: BaseState) -> Status:
        if state.lean is None and state.fallen:
            self.feedback_message = "its legs carry no load"
            return SUCCESS
        if state.lean is None:
            return self.fail("no sensor measures how it stands")
        self.feedback_message = f"it leans by {math.degrees(state.lean):.0f} deg"
        return SUCCESS if state.fallen else self.fail(self.feedback_message)


MAX_SIDE_PITCH = math.radians(30)
"""Pitch of the trunk in radians below which a fallen robot counts as lying on its side."""

ACT_TIME_LIMIT = 20.0
"""Seconds that standing up or sitting down may take."""

DEFAULT_CYCLE_TIME = 2.0
"""Assumed seconds for one cycle of a gait whose file gives no period."""

UPRIGHT_TIMEOUT = 2.0
"""Seconds after the last pose of a movement within which the robot must be upright."""


class LegActLeaf(WalkMotion):
    """Base class of leaves that perform an ``act`` of the legs (``drivers.api.base.LEG_ACTS``), such as ``stand``."""

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
    """Stand: move the legs slowly to the pose in which a walk begins.

    Running until the robot stands, then succeeds; the legs stay stiff. It works from upright, from a sit, or in
    between. Fails if the legs are elsewhere (the robot lies, or sits on a chair). It also fails after a fall, for a
    base without legs, and while the base is latched. A halt keeps the legs where they are.
    """

    tag = "stand"
    example = "- stand"
    act = "stand"


class Sit(LegActLeaf):
    """Sit down on the heels, slowly, with the weight over the soles; `stride.sit` sets how low.

    Running until the robot sits, then succeeds; the legs stay stiff. Fails, and is halted, as `stand`.
    """

    tag = "sit"
    example = "- sit"
    act = "sit"


class PlayGait(WalkMotion):
    """Play a gait of `config/gaits` or of a file: the joint cycle over and over, without balance control.

    The robot stands first. The gait grows out of the stand within a cycle, and returns to it within another. Running
    until it has played all cycles and stands again, then succeeds. A halt ends in a stand too. Fails if the legs cannot
    perform the gait, and names the joint and the time; also fails as `stand`.
    """

    tag = "play_gait"
    example = "- play_gait: {gait: curve, cycles: 4}"
    needs = frozenset({"base", "legs"})
    output_doc = "the number of cycles played"
    output_type = float
    gait: GaitKeys = argument("gait", "gait: a name, or a file (.yaml)", principal=True)
    cycles: int | None = argument("count", "number of cycles; plays until halted by default", default=None, low=1)
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
    """Get up after a fall: play `front` if the robot lies on its face, `back` if it lies on its back.

    Running until the movement is over and the robot is upright, then succeeds, and the base accepts commands again.
    Fails if the robot has not fallen, if it lies on its side, or if the movement for its position is not given. It also
    fails if it is not upright in the end, and while the base is latched for another reason. A halt holds the joints
    where they are.
    """

    tag = "get_up"
    example = "- get_up: {front: get_up_front}"
    needs = frozenset({"arm", "base", "imu"})
    drives = frozenset({"arm", "base"})
    halt_limit = STAND_TIMEOUT
    run_in = RUN_IN_SPEED
    front: Movement | None = argument("move", "movement to get up from the face: a name, or a file", default=None)
    back: Movement | None = argument("move", "movement to get up from the back: a name, or a file", default=None)
    speed: float = argument(
        "number", "factor of the recorded speed; 0.5 is half the speed", default=1.0, low=0.05, high=2.0
    )
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
                return self.fail("it lies on its side: there is no movement for that")
            word, where = ("front", "face") if attitude.value.pitch > 0 else ("back", "back")
            self._chosen = self.front if word == "front" else self.back
            if self._chosen is None:
                return self.fail(f"it lies on its {where}: give the movement `{word}`")
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
