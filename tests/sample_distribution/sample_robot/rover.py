"""The rover: lines of text over a serial port.

It takes ``v 250 -100``: millimetres and milliradians a second, valid for 0.3 s; ``b 440 200``: a tone in hertz and
milliseconds. Fifty times a second it says ``o 1200 -35 1570 250 -100``: where it is, its heading, how it moves.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from math import inf
from threading import RLock

from drivers.api import (
    Away,
    BaseLimits,
    BaseState,
    Health,
    Lamp,
    Pose2D,
    Quality,
    Reading,
    Reflexes,
    Source,
    Steered,
    Steering,
    Tune,
    Velocity,
    ignore,
)
from drivers.api.driver import Site
from drivers.base.limits import Limits
from drivers.base.velocity_multiplexer import VelocityMultiplexer
from drivers.clock import Clock
from drivers.errors import BadRequest, DeviceFault, NotConnected
from drivers.transport.history import History
from drivers.transport.link import Link
from sample_robot.declared import RoverKeys

SILENT = 0.3
"""Seconds without a report after which it counts as silent."""


def make(keys: RoverKeys, site: Site) -> "Rover":
    """Return the driver."""
    limits = BaseLimits(keys.max_speed, keys.max_turn, keys.acceleration, keys.turn_acceleration)
    return Rover(
        Link("base", site.port, keys.baud, report=site.report),
        site.clock,
        limits,
        reflexes=keys.reflexes,
        away=keys.away,
        steered=site.steered,
        horn=keys.horn,
    )


class Rover:
    """A ``drivers.api.Base``. It feels nothing, and has no lights."""

    name = "base"

    def __init__(
        self,
        link: Link,
        clock: Clock,
        limits: BaseLimits,
        *,
        reflexes: Reflexes,
        away: Away,
        steered: Steered = ignore,
        horn: bool = True,
    ) -> None:
        self._link, self._clock, self._limits, self._horn = link, clock, limits, horn
        bounds = Limits(limits.speed, limits.turn, limits.acceleration, limits.turn_acceleration)
        self._mux = VelocityMultiplexer(bounds, reflexes, away)
        self._steered: Callable[[Steering], None] = steered
        self._told = self._mux.steering
        self._lock = RLock()
        self._begun = b""
        self._latest: Reading[BaseState] = Reading(None, -inf, Quality.NONE)
        self._heard_at = self._renewed_at = -inf
        self._headings = History()

    def open(self) -> None:
        """Start looking for it."""
        with self._lock:
            self._mux.absence.begin()
        self._link.open(self)

    def rest(self) -> None:
        """Stand still."""
        self.stop()

    def close(self) -> None:
        """Stand still and release the port."""
        self.stop()
        self._link.close()

    def health(self) -> Health:
        """Say whether its reports arrive."""
        link = self._link.health()
        if not link.online:
            return link
        returned = self._mux.absence.returned
        if self._hears():
            return Health(True, counters=link.counters, returned=returned)
        said = f"base: {self._link.port}: open, but no report of a rover"
        return Health(False, said, "switch the rover on", link.counters, returned)

    @property
    def limits(self) -> BaseLimits:
        """How fast it goes."""
        return self._limits

    def drive(self, velocity: Velocity, *, source: Source = Source.MISSION) -> Velocity:
        """Drive so; see drivers.api.Base."""
        if source is Source.SAFETY or not all(abs(speed) < inf for speed in (velocity.linear, velocity.angular)):
            raise BadRequest(f"base: cannot drive {velocity} for {source}")
        health = self.health()
        if not health.online:
            self.stop()
            raise NotConnected(health.detail, hint=health.hint)
        with self._lock:
            if self._mux.latched:
                raise DeviceFault(f"base: it stands still: {self._mux.latched}", hint="enable it")
            return self._mux.steer(velocity, self._clock.now(), self._latest.value, source)

    def stop(self, *, source: Source | None = None) -> None:
        """Stand still now."""
        with self._lock:
            if self._mux.halt(source):
                with suppress(NotConnected):
                    self._link.write(b"v 0 0\n")

    def latch(self, reason: str) -> None:
        """Stand still until it is enabled."""
        with self._lock:
            self._mux.latch(reason)
            self.stop()

    def enable(self) -> None:
        """End that."""
        with self._lock:
            self._mux.enable()

    @property
    def latched(self) -> str:
        """Why it is latched."""
        return self._mux.latched

    def steering(self) -> Steering:
        """Return who commands it."""
        return self._mux.steering

    def play(self, tune: Tune) -> None:  # noqa: ARG002 - it has one tone for all
        """Sound the horn."""
        self.tone(440.0, 0.2)

    def tone(self, frequency: float, seconds: float) -> None:
        """Sound the horn."""
        if self._horn:
            self._link.write(b"b %d %d\n" % (frequency, 1000 * seconds))

    def light(self, number: int, colour: Lamp) -> None:
        """Do nothing: it has no lights."""

    def state(self) -> Reading[BaseState]:
        """Return the newest report."""
        return self._latest if self._hears() else replace(self._latest, quality=self._old)

    @property
    def _old(self) -> Quality:
        return Quality.NONE if self._latest.value is None else Quality.STALE

    def heading_at(self, stamp: float) -> float | None:
        """Return the heading at a past time."""
        found = self._headings.at(stamp)
        return None if found is None else found[0]

    # drivers.transport.link.Talker, called from the link's thread.

    def connected(self) -> None:
        """Begin anew."""
        self._begun = b""
        with self._lock:
            self._mux.halt()

    def received(self, data: bytes) -> None:
        """Take in reports."""
        *lines, self._begun = (self._begun + data).split(b"\n")
        for line in lines:
            word, *figures = line.split()
            if word == b"o" and len(figures) == 5:
                self._report(*(int(figure) / 1000 for figure in figures))

    def pulse(self) -> None:
        """Renew the command."""
        now = self._clock.now()
        if now - self._renewed_at < 0.02:
            return
        self._renewed_at = now
        with self._lock:
            due = self._mux.velocity(now, self._latest.value if self._hears() else None)
            self._link.write(b"v %d %d\n" % (round(1000 * due.linear), round(1000 * due.angular)))
            steering = self._mux.steering
        if steering != self._told:
            self._told = steering
            self._steered(steering)

    def ending(self) -> None:
        """Stand still, as the last word."""
        self.stop()

    def _report(self, x: float, y: float, heading: float, linear: float, angular: float) -> None:
        now = self._clock.now()
        state = BaseState(Pose2D(x, y, heading), Velocity(linear, angular), battery_voltage=12.0, battery_percent=80.0)
        self._latest = Reading(state, now, Quality.GOOD)
        self._headings.add(now, [heading])
        with self._lock:
            self._mux.hear(now)
            self._mux.feel(state, now)
        self._heard_at = now
        self.pulse()

    def _hears(self) -> bool:
        return self._clock.now() - self._heard_at <= SILENT
