"""Turning on the spot to a heading, exactly: what all leaves do the same way that end with a turn."""

import math

from py_trees.common import Status

from behaviours.driving.motion import REACTION, TURN_CRAWL, Motion
from behaviours.leaf import SUCCESS
from drivers.api import BaseState, Velocity

FINE = math.radians(0.1)
"""Radians beside the heading that are near enough."""

NUDGE = TURN_CRAWL / 2
"""Turn rate of a correction in rad/s: the wheels of a Kobuki turn at 4 mm/s then, of which it knows whole ones."""

MAX_NUDGE_GRANT = 5.0
"""Seconds by which a correction extends the time limit at most: with rare odometry a turn ends degrees beside."""

NUDGES = 3
"""Corrections at most: where they do not help, more of them will not."""


class Spin(Motion):
    """A motion that turns to a heading.

    How late the base obeys is not known, so it stops up to half a degree beside the heading. What is left it does in
    nudges: for a time that is reckoned before, so that the lag does not matter.
    """

    _nudges = 0
    _nudge: tuple[float, float] | None = None  # its turn rate, and when it ends
    _rolls_until = -math.inf

    def initialise(self) -> None:
        super().initialise()
        self._nudges, self._nudge, self._rolls_until = 0, None, -math.inf

    def resume(self, state: BaseState) -> None:
        super().resume(state)
        self._nudges, self._nudge = 0, None

    def turn_to(self, heading: float, direction: float, speed: float, state: BaseState, doing: str) -> Status:
        """Turn to ``heading`` (radians), left for a positive ``direction``, at ``speed`` rad/s at most.

        Succeeds once it stands still.
        """
        left, now = heading - state.pose.heading, self.run.now()
        if self._nudge is not None:
            rate, ends = self._nudge
            if now < ends:
                return self.steer(Velocity(0.0, rate), doing)
            self._nudge, self._stopping, self._rolls_until = None, False, now + REACTION
            return self.come_to_rest(math.inf)
        rate = self.approach(left * direction, braking=self.turn_braking, crawl=TURN_CRAWL)
        if rate > 0.0 and self._nudges == 0:
            return self.steer(Velocity(0.0, direction * min(rate, speed)), doing)
        if self.come_to_rest(state.velocity.angular) is not SUCCESS or now < self._rolls_until:
            return self.wait("stopping")
        if abs(left) <= FINE or self._nudges == NUDGES:
            return SUCCESS
        self._nudges += 1
        seconds = abs(left) / NUDGE
        self._clock.grant(min(seconds, MAX_NUDGE_GRANT))
        self._nudge = math.copysign(NUDGE, left), now + seconds
        return self.steer(Velocity(0.0, self._nudge[0]), doing)
