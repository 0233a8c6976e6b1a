"""Driver of a base on two driven wheels: connection, arbitration, renewal of commands, and health.

A brand adds a ``DiffDriveProtocol``, which turns bytes into states and velocities into bytes without any I/O. The
current setpoint is sent after each report, and at least every ``RENEWAL_INTERVAL``. So a computer that hangs falls
silent, and the watchdog of the base stops the wheels.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import field, replace
from math import inf
from types import MappingProxyType
from typing import Protocol, Unpack

from drivers.api import (
    ZERO_VELOCITY,
    BaseState,
    DeviceStatus,
    Health,
    Lamp,
    Quality,
    Reading,
    Source,
    Tune,
    Velocity,
    ignore,
)
from drivers.api.fast_dataclass import dataclass
from drivers.base.arbitrated import ArbitratedBase, BaseSettings
from drivers.base.limits import check_light, check_tone
from drivers.base.progress_monitor import Instruments
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.transport.link import SerialLink

RENEWAL_INTERVAL = 0.04
"""Seconds between two commands while no report arrives."""

STOP_TIME = 0.5
"""Seconds for which a stop command is repeated every ``RENEWAL_INTERVAL``, since one may be lost on the wire."""

LATCHED_INTERVAL = 0.2
"""Longest interval in seconds between two stop commands to a latched base."""

GREETING_INTERVAL = 0.5
"""Seconds after which the request for reports (``DiffDriveProtocol.greet``) is repeated if the base does not report."""

FINAL_STOPS = 5
"""Number of stop commands sent just before the port is closed, since single commands may be damaged on the wire."""


@dataclass(frozen=True, slots=True)
class DiffDriveTiming:
    """Timing of a base on a wire, in seconds.

    A state is stale ``stale_after`` seconds after its measurement; the base is offline ``offline_after`` seconds after
    its last report. A report arrives ``report_delay`` after its measurement. At rest, a command is sent every
    ``idle_interval``, and reports are buffered for ``idle_poll_interval`` before they are read.
    """

    stale_after: float = 0.15
    offline_after: float = 0.3
    report_delay: float = 0.0
    idle_interval: float = 0.2
    idle_poll_interval: float = 0.0


@dataclass(slots=True)
class ParsedReports:
    """Content of the bytes received from a base.

    ``states`` are the reported states, oldest first. ``reply`` are bytes that must be sent to the base. ``faults`` are
    faults to report, each as a message and a hint. ``restarted`` is a message and a hint if the base has restarted,
    else None: a restarted base must not execute earlier commands.
    """

    states: list[BaseState] = field(default_factory=list)
    reply: bytes = b""
    faults: list[tuple[str, str]] = field(default_factory=list)
    restarted: tuple[str, str] | None = None


class SoundProtocol(Protocol):
    """Protocol of the sounder of a base: its methods return the bytes of a command, and send nothing."""

    def play(self, tune: Tune) -> bytes:
        """Return the command that plays a tune."""
        ...

    def tone(self, frequency: float, seconds: float) -> bytes:
        """Return the command that plays a tone of ``frequency`` Hz."""
        ...


class LightProtocol(Protocol):
    """Protocol of the two lights of a base: its methods return the bytes of a command, and send nothing."""

    def light(self, number: int, colour: Lamp) -> bytes:
        """Return the command that switches light 1 or 2."""
        ...


class DiffDriveProtocol(ABC):
    """Protocol of one brand, without I/O: methods return the bytes to send, none if there is nothing to send.

    Times are seconds on a monotonic clock. ``DiffDriveBase`` calls all methods with its lock held.

    Attributes:
        instruments: names of the instruments that measure the motion.
        timing: may be a property, for a base whose report interval varies.
        model: the device in error messages, such as ``a Kobuki``.
        noun: the device in hints, such as ``rover``.
        sounds: commands of the sounder; None for a base without one.
        lights: commands of the lights; None for a base without lights.
    """

    instruments = Instruments()
    timing = DiffDriveTiming()
    model = "a base"
    noun = "base"
    sounds: SoundProtocol | None = None
    lights: LightProtocol | None = None

    def restart(self) -> None:  # noqa: B027 - optional
        """Drop partial messages of the previous connection; the pose of the base is kept."""

    @abstractmethod
    def greet(self) -> bytes:
        """Return the bytes that start a connection: settings of the base, and a request for reports.

        ``DiffDriveBase`` sends them again while the base does not report.
        """

    @abstractmethod
    def parse(self, data: bytes, now: float) -> ParsedReports:
        """Parse a chunk of bytes from the base, which arrived at ``now``. It may begin and end within a message."""

    @abstractmethod
    def drive(self, velocity: Velocity, now: float) -> bytes:
        """Return the command that drives at ``velocity``."""

    def stop(self, now: float) -> bytes:
        """Return the command that stops the wheels.

        A protocol whose wire may lose commands overrides this method to return several copies of the command.
        """
        return self.drive(ZERO_VELOCITY, now)

    def query(self, now: float) -> bytes:  # noqa: ARG002
        """Return the bytes of a query, such as for the firmware version, if one is due at ``now``; else no bytes."""
        return b""

    def is_ready(self, now: float) -> bool:  # noqa: ARG002
        """Return False if the base reports but cannot be driven, such as while no node subscribes to its commands."""
        return True

    def counters(self) -> Mapping[str, int]:
        """Return the protocol's counters, such as the number of malformed messages, for ``drivers.api.Health``."""
        return MappingProxyType({})

    def offline_reason(self, now: float, where: str, baud: int, *, silent: bool) -> tuple[str, str]:  # noqa: ARG002
        """Return the reason why an open port brings no reports of the base, and a hint.

        ``where`` names part and port. ``silent`` is True if no bytes arrive at all.
        """
        if silent:
            reason = f"{where}: open but silent; is the {self.noun} switched on?"
            return reason, f"switch the {self.noun} on; then check its cable"
        return f"{where}: bytes arrive, but no report of {self.model}", f"is it the right port, at {baud} baud?"


Send = Callable[[Callable[[], bytes]], None]
"""Function that calls its argument, which makes the bytes of a command, and sends these bytes. Raises NotConnected."""


class SoundsOnWire:
    """Sounder of a base on a wire: a ``drivers.api.Sounds``."""

    def __init__(self, name: str, protocol: SoundProtocol, send: Send) -> None:
        self.name = name
        self._protocol, self._send = protocol, send

    def play(self, tune: Tune) -> None:
        """Play a tune. Raises NotConnected."""
        self._send(lambda: self._protocol.play(tune))

    def tone(self, frequency: float, seconds: float) -> None:
        """Play a tone of ``frequency`` Hz. Raises BadRequest, NotConnected."""
        check_tone(self.name, frequency, seconds)
        self._send(lambda: self._protocol.tone(frequency, seconds))


class LightsOnWire:
    """Lights of a base on a wire: a ``drivers.api.Lights``."""

    def __init__(self, name: str, protocol: LightProtocol, send: Send) -> None:
        self.name = name
        self._protocol, self._send = protocol, send

    def light(self, number: int, colour: Lamp) -> None:
        """Switch light 1 or 2. Raises BadRequest for another number, and NotConnected."""
        check_light(self.name, number)
        self._send(lambda: self._protocol.light(number, colour))


class DiffDriveBase(ArbitratedBase):
    """Driver of a base that speaks ``protocol`` over the serial ``link``: a ``drivers.api.Base``.

    It owns both. ``on_stop`` is called when all sources are stopped or the base is latched, so that other nodes that
    drive the base can be stopped too. The callbacks in the settings run on the link's thread, and must return at once.
    The link calls the ``on_...`` methods (``drivers.transport.link.LinkHandler``) on this thread as well.
    """

    def __init__(
        self,
        link: SerialLink,
        clock: Clock,
        protocol: DiffDriveProtocol,
        *,
        on_stop: Callable[[], None] = ignore,
        **settings: Unpack[BaseSettings],
    ) -> None:
        super().__init__(clock, instruments=protocol.instruments, **settings)
        self.protocol = protocol
        if protocol.sounds is not None:
            self.sounds = SoundsOnWire(self.name, protocol.sounds, self._send_extra)
        if protocol.lights is not None:
            self.lights = LightsOnWire(self.name, protocol.lights, self._send_extra)
        self._link = link
        self._on_stop = on_stop
        self._closing = self._dozing = False
        # Written by the link's thread alone, and replaced, never altered: any thread may read it.
        self._latest: Reading[BaseState] = Reading(None, -inf, Quality.NONE)
        self._connected_at = self._heard_at = self._bytes_at = -inf
        self._renewed_at = self._sent_at = self._moved_at = self._greeted_at = -inf

    def open(self) -> None:
        """Start to look for the base; return at once."""
        with self._lock:
            self._closing = False
            self._mux.absence.restart()
        self._link.open(self)

    def state(self) -> Reading[BaseState]:
        """Return the last reported state."""
        latest, now, timing = self._latest, self._clock.now(), self.protocol.timing
        if latest.value is None:
            return replace(latest, stamp=now)
        fresh = now - latest.stamp <= timing.stale_after + timing.idle_poll_interval * self._dozing
        return latest if fresh else replace(latest, quality=Quality.STALE)

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Request a velocity, as ``ArbitratedBase.drive`` does.

        If the base rests, its thread is woken to send the velocity at once.
        """
        accepted = super().drive(velocity, source=source)
        if self._dozing and accepted != ZERO_VELOCITY:
            self._link.wake()
        return accepted

    def stop(self, *, source: Source | None = None) -> None:
        """Stop the base, as ``ArbitratedBase.stop`` does; if ``source`` is None, also call ``on_stop``."""
        super().stop(source=source)
        if source is None and not self._closing:
            self._on_stop()

    def close(self) -> None:
        """Stop the wheels, end the thread and release the port. Safe from any state, more than once."""
        with self._lock:
            self._closing = True  # from here on every renewal is a zero as well
        try:
            self._send_final_stops()
        finally:
            self._link.close()

    def health(self) -> Health:
        """Return whether reports arrive, and the counters of the wire."""
        link = self._link.health()
        counters = {**link.counters, **self.protocol.counters(), **self._mux.command_delays.counters("command")}
        returned = self._mux.absence.reconnected_at
        if (error := self._offline_error(self._clock.now())) is None:
            return Health(True, counters=counters, reconnected_at=returned)
        return Health(False, str(error), error.hint, counters, returned)

    # --- drivers.transport.link.LinkHandler ---------------------------------------------------------------------------

    def on_connected(self) -> None:
        """Send the first request for reports on a port that was just opened, and drop all earlier setpoints."""
        now = self._clock.now()
        with self._lock:
            self._mux.stop()
            self.protocol.restart()
        self._connected_at = self._moved_at = now  # a program before this one may have left it moving
        self._silent = False
        self._greet(now)

    def on_data(self, data: bytes) -> None:
        """Parse reports, and respond to them at once."""
        now = self._bytes_at = self._clock.now()
        with self._lock, self._stopping_on_error():
            parsed = self.protocol.parse(data, now - self.protocol.timing.report_delay)
            if parsed.restarted is not None:
                self._mux.on_report(now, restarted=True)
        faults = [*parsed.faults, *([] if parsed.restarted is None else [parsed.restarted])]
        for fault, hint in faults:
            self._report(DeviceStatus(self.name, "fault", fault, hint))
        if parsed.states:
            self._take(parsed.states, now)
        if parsed.reply:
            self._link.write(parsed.reply)

    def on_poll(self) -> float | None:
        """Renew the command, send due queries, and report a base that has become silent.

        Returns the seconds for which reports may stay in the buffer, None if they must be read at once.
        """
        now = self._clock.now()
        if now - self._renewed_at >= RENEWAL_INTERVAL:
            self._renew(now)
        if now - max(self._greeted_at, self._heard_at) >= GREETING_INTERVAL:
            self._greet(now)
        self._write(lambda: self.protocol.query(now))
        if not self._silent and now - max(self._connected_at, self._heard_at) > self.protocol.timing.offline_after:
            self._silent = True
            self._report(DeviceStatus(self.name, "offline", *self._offline_reason(now)))
        reported = self._heard_at == self._bytes_at and now - self._heard_at < RENEWAL_INTERVAL
        self._dozing = reported and self._is_idle(now)
        return self.protocol.timing.idle_poll_interval if self._dozing and not self._mux.request_pending else None

    def on_closing(self) -> None:
        """Stop the wheels as the thread ends, for any reason."""
        self._send_final_stops()

    # --- the inside ---------------------------------------------------------------------------------------------------

    def _take(self, states: list[BaseState], now: float) -> None:
        """Store newly reported states (oldest first), apply reflexes, send the next velocity. Raises NotConnected."""
        before, stamp = self._latest.value, now - self.protocol.timing.report_delay
        self._latest = Reading(states[-1], stamp, Quality.GOOD)
        self._remember(stamp, states[-1].pose)
        with self._lock:
            self._mux.on_report(now)
            for state in states:  # a contact may last for a single one
                self._mux.on_state(state, now)
        self._heard_at = now  # last: a thread that sees the base online also sees its state
        self._renew(now)
        self._report_online(f"{self._link.port}: the base reports again")
        self._report_changes(before, states)

    def _is_idle(self, now: float) -> bool:
        """Return whether the base has been at rest for a while, so that several reports may be read at once."""
        # A base that counts as disconnected after a short silence needs each report.
        doze = self.protocol.timing.idle_poll_interval
        may_doze = doze > 0.0 and self._mux.absence.min_absence > 3 * doze
        return may_doze and now - self._moved_at >= STOP_TIME and not self._mux.needs_pose

    def _greet(self, now: float) -> None:
        self._greeted_at = now
        self._write(self.protocol.greet)

    def _send_final_stops(self) -> None:
        for _ in range(FINAL_STOPS):
            self.stop()

    def _renew(self, now: float) -> None:
        """Send the current setpoint; skip it if the base is idle and was sent zero recently. Raises NotConnected."""
        with self._lock, self._stopping_on_error():
            state = self._latest.value if self._is_online(now) else None
            if self._closing:
                self._mux.stop()
            velocity = self._mux.next_velocity(now, state)
            if velocity != ZERO_VELOCITY:
                self._moved_at = now
            idle_interval = self.protocol.timing.idle_interval
            if self._mux.latched:
                idle_interval = min(idle_interval, LATCHED_INTERVAL)
            if now - self._moved_at < STOP_TIME:
                self._send(self.protocol.stop(now) if velocity == ZERO_VELOCITY else self.protocol.drive(velocity, now))
            elif now - self._sent_at >= idle_interval:
                self._send(self.protocol.drive(velocity, now))
            steering = self._mux.steering
        self._renewed_at = now
        self._report_steering(steering)

    def _send(self, command: bytes) -> None:
        self._sent_at = self._clock.now()
        if command:
            self._link.write(command)

    def _write(self, make: Callable[[], bytes]) -> None:
        with self._lock:
            if data := make():
                self._link.write(data)

    def _is_online(self, now: float) -> bool:
        """Return whether reports arrive on this connection, and the base can be driven."""
        reports = self._heard_at >= self._connected_at and now - self._heard_at <= self.protocol.timing.offline_after
        return reports and self.protocol.is_ready(now)

    @property
    def _last_state(self) -> BaseState | None:
        return self._latest.value

    def _offline_error(self, now: float) -> NotConnected | None:
        if self._link.online and self._is_online(now):
            return None
        link = self._link.health()
        detail, hint = self._offline_reason(now) if link.online else (link.detail, link.hint)
        return NotConnected(detail, hint=hint)

    def _offline_reason(self, now: float) -> tuple[str, str]:
        silent = now - self._bytes_at > self.protocol.timing.offline_after
        return self.protocol.offline_reason(now, f"{self.name}: {self._link.port}", self._link.baud, silent=silent)

    def _send_extra(self, make: Callable[[], bytes]) -> None:
        """Send a command that does not move the base. Raises NotConnected."""
        if (error := self._offline_error(self._clock.now())) is not None:
            raise error
        self._write(make)

    def _send_stop(self) -> None:
        now = self._clock.now()
        self._moved_at = now  # so that renewals repeat it: one may be lost
        with suppress(NotConnected):
            self._send(self.protocol.stop(now))
