"""The Kobuki as a base: its velocity renewed while it is valid, its state up to date.

The base reports 50 times a second, and is told after each report how to move: so a computer that hangs falls silent.
The deadman, the limits and what the touch forbids are applied there, in the link's thread, whatever the caller does.
"""

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from math import inf

from drivers.api import (
    STILL,
    Away,
    BaseLimits,
    BaseState,
    Health,
    Notice,
    Quality,
    Reading,
    Reflexes,
    Report,
    Source,
    Steered,
    Steering,
    Velocity,
    unheard,
    unreported,
    unsteered,
)
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.guard import guarded
from drivers.history import History
from drivers.kobuki.commands import BaseControl, RequestExtra
from drivers.kobuki.helm import Helm
from drivers.kobuki.limits import Limits
from drivers.kobuki.listener import Identity, Listener
from drivers.kobuki.panel import Panel
from drivers.kobuki.requests import check, require
from drivers.kobuki.senses import compare
from drivers.kobuki.telemetry import Telemetry
from drivers.kobuki.wire import encode
from drivers.link import Link

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

ASKING = 0.5
"""Seconds between questions for what the base has not yet told of itself."""

FIRMWARE_MAJOR = 1
"""The one generation of the firmware that speaks this protocol."""


class KobukiBase(Panel):
    """A ``drivers.api.Base`` over a link at ``wire.BAUD``, which it owns: nobody else opens, writes or closes it.

    Speeds in m/s and rad/s, accelerations in m/s^2 and rad/s^2 (braking is 1.2 times as hard). ``changed`` is called
    from the link's thread whenever a contact or button changes, ``steered`` with whatever is new of who commands it;
    both must return at once. Raises ValueError for a limit that is not positive.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        *,
        max_linear: float = 0.5,
        max_angular: float = 1.9,
        linear_acceleration: float = 0.5,
        angular_acceleration: float = 3.5,
        reflexes: Reflexes | None = None,
        away: Away | None = None,
        report: Report = unreported,
        changed: Callable[[], None] = unheard,
        steered: Steered = unsteered,
        name: str = "base",
    ) -> None:
        super().__init__(name, link)
        self._clock = clock
        self._report = guarded(report)
        self._changed = guarded(changed)
        self._steered = guarded(steered)
        limits = Limits(max_linear, max_angular, linear_acceleration, angular_acceleration)
        self._limits = limits.told
        self._helm = Helm(limits, reflexes, away)
        self._told = self._helm.steering
        self._closing = False
        self._listener = Listener()
        self._headings = History()
        # Written by the link's thread alone, and replaced, never altered: any thread may read them.
        self._latest: Reading[BaseState] = Reading(None, -inf, Quality.NONE)
        self._connected_at = self._heard_at = self._bytes_at = -inf
        self._renewed_at = self._sent_at = self._moved_at = self._asked_at = -inf
        self._silent = False

    @property
    def name(self) -> str:
        """The part of the robot that it is."""
        return self._name

    @property
    def identity(self) -> Identity:
        """Versions and unique ID, as far as the base has told them."""
        return self._listener.identity

    def open(self) -> None:
        """Start looking for the base; returns at once, whether it is there or not."""
        with self._lock:
            self._closing = False
            self._helm.absence.begin()
        self._link.open(self)

    @property
    def limits(self) -> BaseLimits:
        """How fast it goes, and how quickly that changes."""
        return self._limits

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Drive so for ``COMMAND_LIFE`` at most; return what is in force of it: limited, and what reflexes permit.

        The base gets there by its acceleration limits. Raises BadRequest for a value that is not finite and for
        ``Source.SAFETY``, DeviceFault while it is latched, and NotConnected when no reports arrive: it does not drive
        blind, and tells the base to stand still.
        """
        check(self._name, velocity, source)
        now = self._clock.now()
        if not (self._link.online and self._hears(now)):
            self.stop()
            raise self._unheard(now)
        with self._lock:
            require(self._name, self._helm.latched)
            return self._helm.steer(velocity, now, self._latest.value, source)

    def stop(self, *, source: Source | None = None) -> None:
        """Stand still now, without any ramp: forget what ``source`` commands, or anybody (None).

        Safe from any state, more than once; does not raise when offline.
        """
        with self._lock:
            if self._helm.halt(source):
                with suppress(NotConnected):
                    self._send(STILL)

    def latch(self, reason: str) -> None:
        """Stand still until ``enable``, whoever commands. Safe from any state, more than once."""
        with self._lock:
            self._helm.latch(reason)
            self.stop()

    def enable(self) -> None:
        """End a latched stop; nothing of before is in force then."""
        with self._lock:
            self._helm.enable()

    @property
    def latched(self) -> str:
        """Why it is latched; empty while it is not."""
        return self._helm.latched

    def steering(self) -> Steering:
        """Return who commands it, and what came of that, as of the last renewal."""
        return self._helm.steering

    def telemetry(self) -> Telemetry:
        """Return the newest of what the base reports beyond its state."""
        return Telemetry().updated(tuple(self._listener.newest.values()))

    def state(self) -> Reading[BaseState]:
        """The newest report; stale when it was measured more than ``STALE_AFTER`` ago."""
        latest, now = self._latest, self._clock.now()
        if latest.value is None:
            return replace(latest, stamp=now)
        return latest if now - latest.stamp <= STALE_AFTER else replace(latest, quality=Quality.STALE)

    def heading_at(self, stamp: float) -> float | None:
        """The heading in radians at a past time (the last 3 s), interpolated; None when that is not known."""
        found = self._headings.at(stamp)
        return found[0] if found else None

    def rest(self) -> None:
        """Stand still: the only rest of a base."""
        self.stop()

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
        counters = {**link.counters, **self._listener.counters(), **self._helm.waits.counters("command")}
        now, returned = self._clock.now(), self._helm.absence.returned
        if self._hears(now) and link.online:
            return Health(True, counters=counters, returned=returned)
        detail, hint = self._silence(now) if link.online else (link.detail, link.hint)
        return Health(False, detail, hint, counters, returned)

    # What follows is drivers.link.Talker, called from the link's thread.

    def connected(self) -> None:
        """Begin anew on a port just opened: nothing of before is in force, but the pose goes on from where it was."""
        with self._lock:
            self._helm.halt()
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
            self._headings.add(self._latest.stamp, [states[-1].pose.heading])
            with self._lock:
                self._helm.hear(now)
                for state in states:  # a read may bring several, and a contact may last for one
                    self._helm.feel(state, now)
            self._heard_at = now  # last: who sees it online also sees its state
            self._renew(now)
            self._tell(before, states)
        told = self.identity.firmware
        if told is not None and told is not known and told.major != FIRMWARE_MAJOR:
            self._report(Notice(self._name, "fault", f"firmware {told}, not 1.x", "update it to 1.2.0"))

    def pulse(self) -> None:
        """Renew the command though nothing arrives, ask what is not known yet, and notice silence."""
        now = self._clock.now()
        if now - self._renewed_at >= RENEWAL:
            self._renew(now)
        if self.identity.missing and now - self._asked_at >= ASKING:
            self._asked_at = now
            self._link.write(encode(RequestExtra(self.identity.missing)))
        if not self._silent and now - max(self._connected_at, self._heard_at) > SILENT_AFTER:
            self._silent = True
            self._report(Notice(self._name, "offline", *self._silence(now)))

    def ending(self) -> None:
        """Stand still, as the last word of a thread that may have been cut short."""
        self._stop_for_good()

    def _stop_for_good(self) -> None:
        for _ in range(3):  # one of them may be garbled on the wire
            self.stop()

    def _renew(self, now: float) -> None:
        """Send the velocity that is due, unless the base has long been told to stand, and lately.

        Raises NotConnected, which tells the link to look for the port again.
        """
        with self._lock:
            felt = self._latest.value if self._hears(now) else None
            if self._closing:
                self._helm.halt()
            velocity = self._helm.velocity(now, felt)
            if velocity != STILL:
                self._moved_at = now
            if now - self._moved_at < SETTLED or now - self._sent_at >= RESTING:
                self._send(velocity)
            steering = self._helm.steering
        self._renewed_at = now
        if steering != self._told:
            self._told = steering
            self._steered(steering)

    def _send(self, velocity: Velocity) -> None:
        self._sent_at = self._clock.now()
        self._link.write(encode(BaseControl.of(velocity.linear, velocity.angular)))

    def _tell(self, before: BaseState | None, states: Iterable[BaseState]) -> None:
        """Report what has changed from state to state, and that the base is back if it was silent."""
        if self._silent:
            self._silent = False
            self._report(Notice(self._name, "online", f"{self._link.port}: the base reports again"))
        felt = False
        for state in states:
            change = compare(before, state)
            felt = felt or change.felt
            for fault in change.faults:
                self._report(Notice(self._name, "fault", fault, "stand the base on the floor, away from the edge"))
            before = state
        if felt:
            self._changed()

    def _hears(self, now: float) -> bool:
        """True while reports arrive on this connection."""
        return self._heard_at >= self._connected_at and now - self._heard_at <= SILENT_AFTER

    def _unheard(self, now: float) -> NotConnected:
        """Say why a command cannot be taken."""
        link = self._link.health()
        detail, hint = self._silence(now) if link.online else (link.detail, link.hint)
        return NotConnected(detail, hint=hint)

    def _silence(self, now: float) -> tuple[str, str]:
        """Say what is the matter with an open port without reports, and what to try."""
        who = f"{self._name}: {self._link.port}"
        if now - self._bytes_at > SILENT_AFTER:
            return f"{who}: open but silent; is the base switched on?", "switch the base on; then look at its cable"
        return f"{who}: bytes arrive, but no report of a Kobuki", f"is it the right port, at {self._link.baud} baud?"
