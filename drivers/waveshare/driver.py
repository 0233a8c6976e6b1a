"""A rover of Waveshare as a base: its wheels told in JSON, its heartbeat set, its pose measured or reckoned."""

from collections import deque
from math import inf
from typing import Unpack

from drivers.api import DeviceStatus
from drivers.base.arbitrated import Settings
from drivers.base.plain_base import ASKING, PlainBase
from drivers.base.progress_monitor import Instruments
from drivers.base.reckoning import TwoWheels
from drivers.clock import Clock
from drivers.transport.lines import LineFinder
from drivers.transport.link import Link
from drivers.waveshare import wire

PERIOD = 0.02
"""Seconds between two reports that are asked for."""

HEARTBEAT = 0.4
"""Seconds without a command after which the rover is to stop by itself, as a Kobuki does."""

OWN_HEARTBEAT = 3.0
"""The same of a rover that nobody has told otherwise: ``HEART_BEAT_DELAY`` of the vendor's ``ugv_config.h``."""

CONFIRMED = 2.0
"""Seconds in which a rover that echoes has confirmed its heartbeat."""

AGREE = 5
"""Reports of which the middle figure counts: lines have no checksum, and one digit may be garbled."""

EMPTY, FULL = 9.0, 12.6
"""Volts of three lithium cells in a row, which these rovers run on, at 0 and at 100 percent."""


class WaveshareBase(PlainBase):
    """A ``drivers.api.Base`` over a link that it owns.

    ``speed_at_full`` (m/s) is how fast a rover without ``encoders`` goes at full power: its pose is dead reckoning
    then. ``track`` (m) is what its wheels turn it by. Callbacks are called from the link's thread.
    """

    instruments = Instruments("encoders", "encoders")

    def __init__(
        self,
        link: Link,
        clock: Clock,
        *,
        track: float,
        encoders: bool,
        speed_at_full: float,
        **settings: Unpack[Settings],
    ) -> None:
        wheels = TwoWheels(track, wire.FASTEST if encoders else speed_at_full)
        super().__init__(link, clock, wheels, reckoned=not encoders, **settings)
        self._unit = 1.0 if encoders else wire.FULL / speed_at_full  # what is sent for 1 m/s
        self._heartbeat = wire.command(wire.HEARTBEAT, cmd=round(1000 * HEARTBEAT))
        self._lines = LineFinder()
        self._reports: deque[wire.Feedback] = deque(maxlen=AGREE)
        self._confirmed = self._warned = False
        self._unconfirmed_since = inf

    def connected(self) -> None:
        """Begin anew on a port just opened."""
        self._lines = LineFinder()
        self._reports.clear()
        self._warned, self._unconfirmed_since = False, inf
        super().connected()

    def received(self, data: bytes) -> None:
        """Take what the rover says, and obey."""
        now = self._bytes_at = self._clock.now()
        for line in self._lines.feed(data):
            try:
                found = wire.read(line)
            except ValueError:
                self._counters["malformed"] += 1
                continue
            if isinstance(found, wire.Feedback):
                self._feedback(found, now)
            elif found is not None and found.line == self._heartbeat.strip() and not self._confirmed:
                self._confirmed = True
                self._link.write(wire.command(wire.ECHO, cmd=0))
        self._counters["overlong"] = self._lines.overlong

    def pulse(self) -> None:
        """Renew the command, ask again, and say where the heartbeat is not confirmed."""
        super().pulse()
        now = self._clock.now()
        if not self._confirmed and now - self._greeted_at >= ASKING:
            self._greet_now(now)
        if not (self._confirmed or self._warned) and now - self._unconfirmed_since >= CONFIRMED:
            self._warned = True
            what = (
                "the rover does not confirm its heartbeat: should this program be killed, or the cable be pulled, "
                f"it may roll on for {OWN_HEARTBEAT:g} s"
            )
            cure = "update its firmware (ugv_base_general, ugv_base_ros); until then stay within reach of its switch"
            self._report(DeviceStatus(self.name, "fault", what, cure))

    def _feedback(self, found: wire.Feedback, now: float) -> None:
        """Take one report; only the middle one of several counts."""
        self._reports.append(found)
        if len(self._reports) < AGREE:
            return
        left, right, volts = (
            sorted(getattr(each, name) for each in self._reports)[AGREE // 2] for name in ("left", "right", "volts")
        )
        if self._unconfirmed_since == inf:
            self._unconfirmed_since = now
        moves = None if self._reckoned else self._wheels.velocity(left, right)
        percent = min(max(100 * (volts - EMPTY) / (FULL - EMPTY), 0.0), 100.0)
        self._reported(now, moves, volts=volts, percent=percent)

    def _greet(self) -> None:
        """Set the heartbeat, first of all, and have that confirmed; then ask for reports."""
        self._confirmed = False
        self._link.write(
            b"\n"  # ends whatever line has been begun
            + wire.command(wire.ECHO, cmd=1)
            + self._heartbeat
            + wire.command(wire.INTERVAL, cmd=round(1000 * PERIOD))
            + wire.command(wire.FLOW, cmd=1)
        )

    def _go(self, left: float, right: float) -> None:
        self._link.write(wire.speeds(left * self._unit, right * self._unit))

    def _silence(self, now: float) -> tuple[str, str]:
        who = f"{self.name}: {self._link.port}"
        if now - self._bytes_at > ASKING:
            return f"{who}: open but silent; is the rover switched on?", "switch the rover on; then look at its cable"
        return f"{who}: bytes arrive, but no report of a rover", f"is it the right port, at {self._link.baud} baud?"
