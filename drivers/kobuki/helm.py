"""What velocity the base is to have right now: the deadman, the ramp and the touch in one place, without any wire."""

from math import inf

from drivers.api import COMMAND_LIFE, BaseState, Velocity
from drivers.kobuki.limits import STILL, Limits, permitted

LONGEST_STEP = 0.1
"""Seconds of acceleration that are made up for at most after a renewal that came late."""


class Helm:
    """Holds the last command, and turns it into the velocity of each renewal. Not safe between threads."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._wanted, self._wanted_at = STILL, -inf
        self._going, self._going_at = STILL, -inf

    def steer(self, wanted: Velocity, now: float) -> Velocity:
        """Ask for a velocity from time ``now``, for ``COMMAND_LIFE``; return it as limited."""
        self._wanted, self._wanted_at = self._limits.clamp(wanted), now
        return self._wanted

    def halt(self) -> None:
        """Want nothing any more, and begin the next ramp at rest."""
        self._wanted, self._wanted_at = STILL, -inf
        self._going = STILL

    def velocity(self, now: float, felt: BaseState | None) -> Velocity:
        """Return what to send at time ``now``; ``felt`` is the base's state, None when it is not known.

        A command on its way is approached by the ramp. One that has expired or is not permitted ends at once.
        """
        if now - self._wanted_at > COMMAND_LIFE:
            self.halt()
        step = min(now - self._going_at, LONGEST_STEP)
        ramped = self._limits.approach(self._going, permitted(self._wanted, felt), step)
        # Once more, for the ramp may still be on its way down from what was permitted a moment ago.
        self._going, self._going_at = permitted(ramped, felt), now
        return self._going
