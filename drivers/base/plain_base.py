"""A base on two wheels that feels nothing: what all such have in common, whatever the line to them.

Commands are renewed while they are valid, after each report and at least every ``RENEWAL``; a computer that hangs falls
silent, and who is at the other end of the line stops the wheels.
"""

from abc import abstractmethod
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from math import inf
from typing import Unpack

from drivers.api import (
    STILL,
    BaseState,
    DeviceStatus,
    Health,
    Odometers,
    Quality,
    Reading,
    Velocity,
)
from drivers.base.arbitrated import Settings, SteeredBase
from drivers.base.mute import Mute
from drivers.base.reckoning import Reckoning, TwoWheels
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.transport.link import Link

STALE_AFTER = 0.15
"""Seconds after which a report no longer counts as fresh."""

SILENT_AFTER = 0.3
"""Seconds without a report after which the base counts as offline and is told to stand still."""

RENEWAL = 0.04
"""Seconds after which a command is renewed though no report has come."""

RESTING = 0.2
"""Seconds from one renewal to the next while the base stands and is to stand."""

SETTLED = 0.5
"""Seconds for which standing still is renewed at every report before that: commands may be lost on the wire."""

ASKING = 0.5
"""Seconds between greetings to who does not report."""


class PlainBase(Mute, SteeredBase):
    """The half of a ``drivers.api.Base`` on a ``link`` that is the same on all without senses.

    It has no sounder and no lights: what is asked of those is checked, and nothing follows.
    A subclass knows the words. Where the velocity of its wheels is not measured (``reckoned``), pose and velocity are
    dead reckoning: what was sent, added up.
    """

    def __init__(
        self, link: Link, clock: Clock, wheels: TwoWheels, *, reckoned: bool, **settings: Unpack[Settings]
    ) -> None:
        super().__init__(clock, **settings)
        self._link = link
        self._wheels = wheels
        self._reckoned = reckoned
        self._reckoning = Reckoning()
        self._odometers = Odometers(0.0, 0.0, 0.0)
        self._counted_at = -inf
        self._closing = False
        self._counters: Counter[str] = Counter({"reports": 0, "malformed": 0})
        # Written by the link's thread alone, and replaced, never altered: any thread may read it.
        self._latest: Reading[BaseState] = Reading(None, -inf, Quality.NONE)
        self._connected_at = self._heard_at = self._bytes_at = -inf
        self._renewed_at = self._sent_at = self._moved_at = self._greeted_at = -inf

    def open(self) -> None:
        """Start looking for the base; returns at once, whether it is there or not."""
        with self._lock:
            self._closing = False
            self._mux.absence.begin()
        self._link.open(self)

    def state(self) -> Reading[BaseState]:
        """The newest report; stale when it came too long ago, by ``STALE_AFTER``."""
        latest, now = self._latest, self._clock.now()
        if latest.value is None:
            return replace(latest, stamp=now)
        return latest if now - latest.stamp <= self._stale_after else replace(latest, quality=Quality.STALE)

    def close(self) -> None:
        """Stand still, end the thread and release the port. Safe from any state, more than once."""
        with self._lock:
            self._closing = True  # from here on every renewal is a zero as well
        try:
            self._stop_for_good()
        finally:
            self._link.close()

    def health(self) -> Health:
        """Say whether reports of the base arrive, and the figures of its wire."""
        link = self._link.health()
        counters = {**link.counters, **self._counters, **self._mux.waits.counters("command")}
        now, returned = self._clock.now(), self._mux.absence.returned
        if self._hears(now) and link.online:
            return Health(True, counters=counters, returned=returned)
        detail, hint = self._silence(now) if link.online else (link.detail, link.hint)
        return Health(False, detail, hint, counters, returned)

    # What follows is drivers.transport.link.Talker, called from the link's thread.

    def connected(self) -> None:
        """Begin anew on a port just opened: nothing of before is in force, but the pose goes on from where it was."""
        with self._lock:
            self._mux.halt()
            self._reckoning.pause()
            self._counted_at = -inf
        self._connected_at = self._moved_at = self._clock.now()  # it may move, by whoever had the port before
        self._silent = False
        self._greet_now(self._connected_at)

    def pulse(self) -> None:
        """Renew the command though nothing arrives, and notice silence."""
        now = self._clock.now()
        if now - self._renewed_at >= RENEWAL:
            self._renew(now)
        if now - max(self._greeted_at, self._heard_at) >= ASKING:
            self._greet_now(now)
        if not self._silent and now - max(self._connected_at, self._heard_at) > self._silent_after:
            self._silent = True
            self._report(DeviceStatus(self.name, "offline", *self._silence(now)))

    def ending(self) -> None:
        """Stand still, as the last word of a thread that may have been cut short."""
        self._stop_for_good()

    # --- what the subclass adds, and what it calls --------------------------------------------------------------------

    @abstractmethod
    def received(self, data: bytes) -> None:
        """Take what has arrived, cut anywhere, and tell each report by ``_reported``."""

    @abstractmethod
    def _greet(self) -> None:
        """Ask for reports, and set what is to be set. Raises NotConnected."""

    @abstractmethod
    def _go(self, left: float, right: float) -> None:
        """Send how fast the wheels are to turn, in m/s, none faster than it can. Raises NotConnected."""

    @abstractmethod
    def _silence(self, now: float) -> tuple[str, str]:
        """Say what is the matter with an open port without reports, and what to try."""

    def _reported(self, now: float, moves: Velocity | None, *, volts: float = 0.0, percent: float = 100.0) -> None:
        """Take a report: how it ``moves``, and its battery, where that is measured. Raises NotConnected."""
        with self._lock:
            if not self._reckoned:
                self._count(now)
            self._reckoning.advance(now, moves)
            pose, velocity = self._reckoning.pose, self._reckoning.velocity
            state = BaseState(pose, velocity, battery_voltage=volts, battery_percent=percent, reckoned=self._reckoned)
            if not self._reckoned:
                state = replace(state, odometers=self._odometers)
            self._take(state, now)

    def _count(self, now: float) -> None:
        """Add up how far the wheels have turned since the report before, at the speeds that it told."""
        left, right = self._wheels.rims(self._reckoning.velocity)
        passed = max(now - self._counted_at, 0.0) if self._counted_at > -inf else 0.0
        before, self._counted_at = self._odometers, now
        left, right = before.left + left * passed, before.right + right * passed
        self._odometers = Odometers(left, right, (right - left) / self._wheels.track)

    def _take(self, state: BaseState, now: float) -> None:
        """Take a state that the base has reported just now. Raises NotConnected."""
        self._counters["reports"] += 1
        with self._lock:
            self._latest = Reading(state, now, Quality.GOOD)
            self._remember(now, state.pose)
            self._mux.hear(now)
            self._mux.feel(state, now)
        self._heard_at = now  # last: who sees it online also sees its state
        self._renew(now)
        self._tell_return(f"{self._link.port}: the base reports again")

    def _begun_anew(self, why: str, hint: str) -> None:
        """Let nothing of before be in force: who is at the other end has begun anew."""
        with self._lock:
            self._mux.halt()
            self._mux.absence.heard(self._clock.now(), anew=True)
        self._report(DeviceStatus(self.name, "fault", why, hint))

    @property
    def _stale_after(self) -> float:
        """Seconds after which a report is no longer fresh."""
        return STALE_AFTER

    @property
    def _silent_after(self) -> float:
        """Seconds without a report after which the base counts as offline."""
        return SILENT_AFTER

    @property
    def _resting(self) -> float:
        """Seconds from one renewal to the next while it stands and is to stand."""
        return RESTING

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _greet_now(self, now: float) -> None:
        self._greeted_at = now
        self._greet()

    def _stop_for_good(self) -> None:
        for _ in range(3):  # one of them may be garbled on the wire
            self.stop()

    def _renew(self, now: float) -> None:
        """Send the velocity that is due, unless the base has long been told to stand, and lately.

        Raises NotConnected, which tells the link to look for the port again.
        """
        with self._lock, self._standing_on_error():
            felt = self._latest.value if self._hears(now) else None
            if self._closing:
                self._mux.halt()
            velocity = self._mux.velocity(now, felt)
            if velocity != STILL:
                self._moved_at = now
            if now - self._moved_at < SETTLED or now - self._sent_at >= self._resting:
                self._send(velocity)
            steering = self._mux.steering
        self._renewed_at = now
        self._tell_steering(steering)

    def _send(self, velocity: Velocity) -> None:
        self._sent_at = self._clock.now()
        given = self._wheels.within(velocity)
        self._go(*self._wheels.rims(given))
        if self._reckoned:
            self._reckoning.advance(self._sent_at, given)

    def _hears(self, now: float) -> bool:
        """True while reports arrive on this connection."""
        return self._heard_at >= self._connected_at and now - self._heard_at <= self._silent_after

    @property
    def _newest(self) -> BaseState | None:
        return self._latest.value

    def _unheard(self, now: float) -> NotConnected | None:
        """Say why a command cannot be taken."""
        if self._link.online and self._hears(now):
            return None
        link = self._link.health()
        detail, hint = self._silence(now) if link.online else (link.detail, link.hint)
        return NotConnected(detail, hint=hint)

    def _require(self) -> None:
        """Raise NotConnected unless it is there."""
        absent = self._unheard(self._clock.now())
        if absent is not None:
            raise absent

    def _stand(self) -> None:
        with suppress(NotConnected):
            self._send(STILL)
