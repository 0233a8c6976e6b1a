"""The velocity that a base is to have right now: sources, deadman, reflexes and ramp in one place, without any wire."""

from dataclasses import replace
from math import inf

from drivers.absence import Absence
from drivers.api import STILL, Away, BaseLimits, BaseState, Reflexes, Source, Steering, Velocity
from drivers.delays import Delays
from drivers.errors import BadRequest
from drivers.kobuki.arbiter import Arbiter
from drivers.kobuki.limits import Limits
from drivers.kobuki.reflexes import SafetyController

LONGEST_STEP = 0.1
"""Seconds of acceleration that are made up for at most after a renewal that came late."""

ONLY_LIMITED = "limited"


class VelocityMultiplexer:
    """Holds what everybody asked for, and turns it into the velocity of each renewal. Not safe between threads.

    ``steering`` is who commands, and what came of it, as of the last renewal; ``latched`` why it stands until it is
    enabled. ``waits`` are how long commands waited for the renewal that first obeyed them. ``absence`` is how long the
    base was away.
    """

    def __init__(self, limits: Limits, reflexes: Reflexes | None = None, away: Away | None = None) -> None:
        self._limits = self._widest = limits
        self._reflexes = reflexes or Reflexes()
        self._arbiter = Arbiter()
        self._controller = SafetyController(self._reflexes)
        self._going, self._going_at = STILL, -inf
        self._safety: tuple[Velocity, str] | None = None  # what a reflex does now, and why
        self._buttons: frozenset[int] = frozenset()
        self.steering = Steering(None, STILL, STILL)
        self.latched = ""
        self.absence = Absence(away)
        self.waits = Delays()
        self._waiting_since: float | None = None  # the newest command, for a renewal to obey it

    @property
    def waiting(self) -> bool:
        """True while a command waits for the renewal that first obeys it."""
        return self._waiting_since is not None

    @property
    def alert(self) -> bool:
        """True while its reflexes have to know where the base is, from state to state."""
        return self._controller.alert

    def steer(self, wanted: Velocity, now: float, felt: BaseState | None, source: Source = Source.MISSION) -> Velocity:
        """Ask for a velocity from time ``now``, for ``COMMAND_LIFE``; return what of it is in force with what is felt.

        That is nothing while a more important source has the wheels.
        """
        self._arbiter.ask(source, wanted, now)
        if self.latched or self.steering.source is Source.SAFETY or self._arbiter.decide(now)[0] is not source:
            return STILL
        self._waiting_since = now
        return self._controller.permit(self._limits.clamp(wanted), felt)[0]

    def halt(self, source: Source | None = None) -> bool:
        """Want no longer what ``source`` wanted, or what anybody did (None); say whether the base is to stand now.

        It does so without a ramp, and begins the next one at rest.
        """
        self._arbiter.forget(source)
        self._waiting_since = None
        if source is not None and self.steering.source not in (source, None):
            return False
        self._controller.calm()
        self._safety = None
        self._going = STILL
        self.steering = Steering(None, STILL, STILL)
        return True

    def curb(self, speed: float, turn: float) -> BaseLimits:
        """Go no faster than so (m/s, rad/s), and no faster than it was made for; return what holds.

        Raises BadRequest for what is not positive.
        """
        widest = self._widest
        try:
            self._limits = replace(
                widest, max_linear=min(speed, widest.max_linear), max_angular=min(turn, widest.max_angular)
            )
        except ValueError as error:
            raise BadRequest(str(error)) from error
        return self._limits.told

    def latch(self, reason: str) -> None:
        """Stand still until ``enable``, for the first reason given."""
        self.halt()
        self.latched = self.latched or reason

    def enable(self) -> None:
        """End a latched stop; nothing of before is in force."""
        self.halt()
        self.latched = ""
        self.absence.enable()

    def hear(self, now: float) -> None:
        """Note that the base reports at time ``now``: after too long a silence nothing of before is in force."""
        if self.absence.heard(now):
            self.halt()
            if self.absence.latched:
                self.latch(self.absence.latched)

    def feel(self, felt: BaseState, now: float) -> None:
        """Take in a state that the base has reported: every one, in their order, for a contact may last for one."""
        self._press(felt.buttons)
        self._safety = self._controller.feel(felt, self._going, now)
        if self._controller.latching:
            self.latch(self._controller.latching)

    def velocity(self, now: float, felt: BaseState | None) -> Velocity:
        """Return what to send at time ``now``; ``felt`` is the newest state, None when it is not known.

        A command on its way is approached by the ramp. One that has expired or is not permitted ends at once.
        """
        source, wanted = self._arbiter.decide(now)
        because = ""
        if self._safety is not None:
            if self.steering.source is not Source.SAFETY:
                self._going = STILL
            source, (wanted, because) = Source.SAFETY, self._safety
        if wanted is None or self.latched:
            source, wanted = (None, STILL) if self.latched else (source, STILL)
            given, because = STILL, self.latched
            self._going = STILL
        else:
            limited = self._limits.clamp(wanted)
            given, forbidden = self._controller.permit(limited, felt)
            because = because or forbidden or ("" if limited == wanted else ONLY_LIMITED)
        step = min(now - self._going_at, LONGEST_STEP)
        ramped = self._limits.approach(self._going, given, step)
        # Once more, for the ramp may still be on its way down from what was permitted a moment ago.
        self._going, self._going_at = self._controller.permit(ramped, felt)[0], now
        self.steering = Steering(source, wanted, given, because)
        if self._waiting_since is not None and source is not Source.SAFETY:
            self.waits.add(max(0.0, now - self._waiting_since))
            self._waiting_since = None
        return self._going

    def _press(self, buttons: frozenset[int]) -> None:
        """Obey the buttons that stop and enable the base, as they go down."""
        if buttons == self._buttons:
            return
        pressed, self._buttons = buttons - self._buttons, buttons
        stop, enable = self._reflexes.stop_button, self._reflexes.enable_button
        if stop in pressed:
            self.latch(f"button {stop} was pressed")
        elif enable in pressed:
            self.enable()
