"""The Kobuki as a base: its velocity renewed while it is valid, its state up to date.

The base reports 50 times a second, and is told after each report how to move: so a computer that hangs falls silent.
The deadman, the limits and what the touch forbids are applied there, in the link's thread, whatever the caller does.
"""

from contextlib import suppress
from dataclasses import replace
from math import inf
from threading import RLock
from typing import Unpack

from drivers.api import (
    STILL,
    BaseState,
    DeviceStatus,
    Health,
    Lamp,
    Quality,
    Reading,
    Source,
    Tune,
    Velocity,
)
from drivers.base.arbitrated import Settings, SteeredBase
from drivers.base.progress_monitor import Instruments
from drivers.base.requests import check_light, check_tone
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.kobuki.commands import BaseControl, RequestExtra, SetOutputs, Sound, SoundSequence
from drivers.kobuki.listener import Identity, Listener
from drivers.kobuki.outputs import TUNES, Outputs
from drivers.kobuki.wire import encode
from drivers.transport.link import Link


class Panel:
    """Commands that do not move the base, sent over ``link``. Safe between threads, which ``lock`` is for."""

    def __init__(self, name: str, link: Link, lock: "RLock") -> None:
        self._name = name
        self._link = link
        self._lock = lock
        self._outputs = Outputs()

    def play(self, tune: Tune) -> None:
        """Play one of the tunes that the base knows. Raises NotConnected."""
        self._link.write(encode(SoundSequence(TUNES[tune])))

    def tone(self, frequency: float, seconds: float) -> None:
        """Play one tone of ``frequency`` hertz, for 0.255 s at most. Raises BadRequest, NotConnected."""
        check_tone(self._name, frequency, seconds)
        self._link.write(encode(Sound.of(frequency, seconds)))

    def light(self, number: int, colour: Lamp) -> None:
        """Switch light 1 or 2. Raises BadRequest for another, NotConnected."""
        check_light(self._name, number)
        with self._lock:
            self._outputs.light(number, colour)
            self._link.write(encode(SetOutputs(self._outputs.word)))

    def restore(self) -> None:
        """Switch everything as it was told so far, for a base that may have been off meanwhile. Raises NotConnected."""
        with self._lock:
            self._link.write(encode(SetOutputs(self._outputs.word)))


STALE_AFTER = 0.1
"""Seconds after which a report no longer counts as fresh: five were missed."""

SILENT_AFTER = 0.25
"""Seconds without a report after which the base counts as offline and is told to stand still. The vendor's driver
takes 0.1 s, which a loaded computer exceeds by itself."""

FRAME_TIME = 0.0075
"""Seconds that a report is on the wire (87 bytes at 115200 baud): it was measured this long before it arrived. The USB
adapter adds 1 ms with its latency timer set, else up to 16, which cannot be known here. The 0.2 s from a command to
the motion do not matter: the heading is measured, not computed from commands."""

RENEWAL = 0.04
"""Seconds after which the command is renewed though no report has come."""

RESTING = 0.2
"""Seconds from one renewal to the next while the base stands and is to stand."""

SETTLED = 0.5
"""Seconds for which standing still is renewed at every report before that: commands may be lost on the wire."""

DOZE = 0.06
"""Seconds for which reports gather while it stands and nobody wants it to move: three, read and thought about at once.
A command wakes it."""

TIMES = 6
"""How often each of these renewals says it. A header that the wire has damaged may claim the next 256 bytes (see
``FrameFinder``): so five renewals are more than it can swallow. They are 60 bytes each, 5 ms on the wire."""

ENOUGH = 5
"""How often it is said at last, at once: nothing follows that could free a stop which was swallowed."""

ASKING = 0.5
"""Seconds between questions for what the base has not yet told of itself."""

FIRMWARE_MAJOR = 1
"""The one generation of the firmware that speaks this protocol."""


class KobukiBase(SteeredBase, Panel):
    """A ``drivers.api.Base`` over a link at ``wire.BAUD``, which it owns: nobody else opens, writes or closes it.

    Callbacks are called from the link's thread, and must return at once.
    """

    instruments = Instruments("encoders", "gyro")

    def __init__(self, link: Link, clock: Clock, **settings: Unpack[Settings]) -> None:
        SteeredBase.__init__(self, clock, **settings)
        Panel.__init__(self, self.name, link, self._lock)
        self._closing = False
        self._listener = Listener()
        # Written by the link's thread alone, and replaced, never altered: any thread may read them.
        self._latest: Reading[BaseState] = Reading(None, -inf, Quality.NONE)
        self._connected_at = self._heard_at = self._bytes_at = -inf
        self._renewed_at = self._sent_at = self._moved_at = self._asked_at = -inf
        self._silent = self._dozing = False

    @property
    def identity(self) -> Identity:
        """Versions and unique ID, as far as the base has told them."""
        return self._listener.identity

    def open(self) -> None:
        """Start looking for the base; returns at once, whether it is there or not."""
        with self._lock:
            self._closing = False
            self._mux.absence.begin()
        self._link.open(self)

    def state(self) -> Reading[BaseState]:
        """The newest report; stale when it was measured more than ``STALE_AFTER`` ago, and ``DOZE`` more at rest."""
        latest, now = self._latest, self._clock.now()
        if latest.value is None:
            return replace(latest, stamp=now)
        fresh = now - latest.stamp <= STALE_AFTER + DOZE * self._dozing
        return latest if fresh else replace(latest, quality=Quality.STALE)

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """See ``SteeredBase.drive``; a base that stands is told with its next report."""
        accepted = super().drive(velocity, source=source)
        if self._dozing and accepted != STILL:
            self._link.wake()
        return accepted

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
        counters = {**link.counters, **self._listener.counters(), **self._mux.waits.counters("command")}
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
        self._listener.restart()
        self._connected_at = self._moved_at = self._clock.now()  # it may move, by whoever had the port before
        self._asked_at = -inf
        self._silent = False
        self.restore()

    def received(self, data: bytes) -> None:
        """Take what the base says, obey what it feels at once, then tell of it."""
        now = self._bytes_at = self._clock.now()
        before, known = self._latest.value, self.identity.firmware
        states = self._listener.feed(data, now - FRAME_TIME)
        if states:
            self._latest = Reading(states[-1], now - FRAME_TIME, Quality.GOOD)
            self._remember(self._latest.stamp, states[-1].pose)
            with self._lock:
                self._mux.hear(now)
                for state in states:  # a read may bring several, and a contact may last for one
                    self._mux.feel(state, now)
            self._heard_at = now  # last: who sees it online also sees its state
            self._renew(now)
            self._tell_return(f"{self._link.port}: the base reports again")
            self._tell(before, states)
        told = self.identity.firmware
        if told is not None and told is not known and told.major != FIRMWARE_MAJOR:
            self._report(DeviceStatus(self.name, "fault", f"firmware {told}, not 1.x", "update it to 1.2.0"))

    def pulse(self) -> float | None:
        """Renew the command though nothing arrives, ask what is not known yet, notice silence; doze where it rests."""
        now = self._clock.now()
        if now - self._renewed_at >= RENEWAL:
            self._renew(now)
        if self.identity.missing and now - self._asked_at >= ASKING:
            self._asked_at = now
            self._link.write(encode(RequestExtra(self.identity.missing)))
        if not self._silent and now - max(self._connected_at, self._heard_at) > SILENT_AFTER:
            self._silent = True
            self._report(DeviceStatus(self.name, "offline", *self._silence(now)))
        self._dozing = self._heard_at == self._bytes_at and now - self._heard_at < RENEWAL and self._rests(now)
        return DOZE if self._dozing and not self._mux.waiting else None

    def _rests(self, now: float) -> bool:
        """Whether it has long stood, and is to stand; who counts the shortest of absences wants every report."""
        mux = self._mux
        long_stood = now - self._moved_at >= SETTLED and mux.absence.shortest > 3 * DOZE
        return long_stood and not mux.alert and not self.identity.missing

    def ending(self) -> None:
        """Stand still, as the last word of a thread that may have been cut short."""
        self._stop_for_good()

    def _stop_for_good(self) -> None:
        for _ in range(ENOUGH):
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
            if now - self._moved_at < SETTLED:
                self._send(velocity, TIMES if velocity == STILL else 1)
            elif now - self._sent_at >= RESTING:
                self._send(velocity)
            steering = self._mux.steering
        self._renewed_at = now
        self._tell_steering(steering)

    def _send(self, velocity: Velocity, times: int = 1) -> None:
        self._listener.commanded(moves=velocity != STILL)
        self._sent_at = self._clock.now()
        self._link.write(encode(BaseControl.of(velocity.linear, velocity.angular)) * times)

    def _hears(self, now: float) -> bool:
        """True while reports arrive on this connection."""
        return self._heard_at >= self._connected_at and now - self._heard_at <= SILENT_AFTER

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

    def _stand(self) -> None:
        with suppress(NotConnected):
            self._send(STILL, TIMES)

    def _silence(self, now: float) -> tuple[str, str]:
        """Say what is the matter with an open port without reports, and what to try."""
        who = f"{self.name}: {self._link.port}"
        if now - self._bytes_at > SILENT_AFTER:
            return f"{who}: open but silent; is the base switched on?", "switch the base on; then look at its cable"
        return f"{who}: bytes arrive, but no report of a Kobuki", f"is it the right port, at {self._link.baud} baud?"
