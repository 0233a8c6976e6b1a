"""Leaves for a base that walks: so far, so long, round on the spot; and whether it has fallen."""

import math

from py_trees.common import Status

from behaviours.driving.motion import Motion, Way
from behaviours.driving.straight import along
from behaviours.feeling import Felt
from behaviours.leaf import SUCCESS, argument
from drivers.api import STILL, Angle, BaseState, Length, Pose2D, Steering, Velocity

PACE = 1.0
"""Seconds that what is left takes at the speed of the approach: steps cannot be shorter than they are."""

LAST = 0.25
"""Seconds of its present speed that a walk still goes on for after it was told to stop, on average."""

SLOWEST, SLOWEST_TURN = 0.03, math.radians(2)
"""How slowly (m/s, rad/s) a walk comes to its goal."""

LAST_STEPS = 4.0
"""Seconds that a walk has to come to a stand."""

GETTING_READY = 15.0
"""Seconds in which the legs come to a stand before a walk begins."""


class Paces(Motion):
    """Walks towards a goal, and ends in a stand; halted, it still makes the steps by which it comes to one."""

    halt_limit = LAST_STEPS

    def paced(self, left: float, speed: float, now: float, *, slowest: float) -> float:
        """Return how fast to go with ``left`` to go, at ``speed`` at most; 0 when it is time to stop."""
        if self._stopping or left <= LAST * abs(now) / 2:
            return 0.0
        return min(speed, max(slowest, left / PACE))

    def halting(self) -> bool:
        reading = self.robot.base.state()
        return reading.good and reading.value is not None and reading.value.velocity != STILL

    def trouble(self, state: BaseState, steering: Steering) -> str:
        return "it has fallen" if state.fallen else super().trouble(state, steering)


def seconds_to_walk(way: float, speed: float, limit: float) -> float:
    """Return how long a walk (m) or turn (rad) by steps can take: it stands up before, and comes to a stand."""
    return abs(way) / max(min(abs(speed), limit), 1e-6) + GETTING_READY + LAST_STEPS


class Walk(Paces):
    """Walk: so far, or on and on.

    With a distance, running until the steps have covered it and it stands, then succeeds; negative is backwards.
    Without one, it walks until it is halted. Halted, it comes to a stand within two steps. Fails when it has fallen,
    when it bumps into something where the base feels that, and while the base is stopped until somebody enables it.
    """

    word = "walk"
    stores = "how far it went, by its steps (m; negative backwards)"
    keeps = Length
    distance: float | None = argument("length", "how far; else until it is halted", default=None, principal=True)
    velocity: float = argument("speed", "how fast; without a distance, negative is backwards", default=0.15)
    turn: float = argument("turn rate", "how fast it turns on the way; positive is to the left", default=0.0)
    _at: Pose2D | None = None
    _gone = 0.0
    _gone_before = 0.0  # when its clock began

    def initialise(self) -> None:
        super().initialise()
        self._at, self._gone, self._gone_before = None, 0.0, 0.0

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        self._at = None  # what a person drives is not of this walk
        self._gone_before = self._gone

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float | None:
        del state, start
        if self.distance is None:
            return None
        left = abs(self.distance) - abs(self._gone_before)
        return seconds_to_walk(left, self.velocity, self.robot.base.limits.speed)

    @property
    def way(self) -> Way:
        return Way.AHEAD if (self.velocity if self.distance is None else self.distance) > 0.0 else Way.BACK

    def go(self, state: BaseState, start: Pose2D) -> Status:
        del start
        if self._at is not None:  # piece by piece, for it may be a curve
            self._gone += along(self._at, state.pose)
        self._at = state.pose
        gone = self.result = self._gone
        if self.distance is not None and self.velocity == 0.0:
            return self.fail("with a velocity of 0 it gets nowhere")
        if self.distance is None:
            return self.steer(Velocity(self.velocity, self.turn), f"{gone:.2f} m")
        way = math.copysign(1.0, self.distance)
        left = (self.distance - gone) * way
        speed = self.paced(left, abs(self.velocity), state.velocity.linear, slowest=SLOWEST)
        if speed == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        return self.steer(Velocity(way * speed, self.turn), f"{gone:.2f} of {self.distance:.2f} m")


class TurnInPlace(Paces):
    """Turn on the spot by steps: to the left for a positive angle.

    Running until the steps have turned it so far and it stands, then succeeds. Fails as `walk` does.
    """

    word = "turn_in_place"
    stores = "how far it turned, by its steps (rad)"
    keeps = Angle
    angle: float = argument("angle", "how far; positive is to the left", principal=True)
    speed: float = argument("turn rate", "how fast", default=math.radians(30), low=math.radians(1), high=math.pi)

    def seconds_needed(self, state: BaseState, start: Pose2D) -> float:
        left = self.angle - (state.pose.heading - start.heading)
        return seconds_to_walk(left, self.speed, self.robot.base.limits.turn)

    @property
    def way(self) -> Way:
        return Way.ROUND

    def go(self, state: BaseState, start: Pose2D) -> Status:
        turned = self.result = state.pose.heading - start.heading
        way = math.copysign(1.0, self.angle)
        left = (self.angle - turned) * way
        speed = self.paced(left, self.speed, state.velocity.angular, slowest=SLOWEST_TURN)
        if speed == 0.0:
            return self.come_to_rest(max(abs(state.velocity.linear), abs(state.velocity.angular)))
        doing = f"{math.degrees(turned):.0f} of {math.degrees(self.angle):.0f} deg"
        return self.steer(Velocity(0.0, way * speed), doing)


class Fallen(Felt):
    """Has it fallen?

    Succeeds while the base leans too far to be standing, or is about to; without an IMU, while its legs bear nothing
    though they should. Fails when not, and where nothing measures that. It never runs.
    """

    word = "fallen"

    def judge(self, state: BaseState) -> Status:
        if state.lean is None and state.fallen:
            self.feedback_message = "its legs bear nothing"
            return SUCCESS
        if state.lean is None:
            return self.fail("nothing measures how it stands")
        self.feedback_message = f"it leans by {math.degrees(state.lean):.0f} deg"
        return SUCCESS if state.fallen else self.fail(self.feedback_message)
