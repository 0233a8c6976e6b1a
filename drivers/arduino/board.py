"""The board of the Rodney head: one wire, and up to two pan/tilt devices and a pair of wheel encoders behind it."""

import math
from collections import Counter
from dataclasses import dataclass, replace
from threading import RLock
from typing import Protocol

from drivers.api import Health, Quality, Reading, Report, unreported
from drivers.arduino import wire
from drivers.arduino.session import Session
from drivers.clock import Clock
from drivers.errors import NotConnected
from drivers.guard import guarded
from drivers.link import Link

STALE = 0.5
"""Seconds after which what the encoders measured is stale: the sketch says it every 50 ms."""


@dataclass(frozen=True, slots=True)
class WheelRates:
    """How fast the wheels turn, in rad/s, forward positive."""

    left: float
    right: float


class Mounted(Protocol):
    """A pan/tilt device on the board. One of the three is called at a time, mostly from the link's thread."""

    def restarted(self) -> None:
        """The sketch has just begun anew: its servos stand where it puts them."""
        ...

    def lost(self) -> None:
        """Nobody hears commands at present."""
        ...

    def due(self, now: float) -> list[wire.ServoAngle]:
        """Return what is to be sent at time ``now``; it will be."""
        ...


class Board:
    """An Arduino or Teensy with a Rodney sketch, found again whenever it was lost: the talker of ``link``.

    Opening the port resets most boards: the first word waits ``boot_delay`` seconds (0 on a pseudo-terminal).
    A board is taken to have started anew on the first connection, on every one if ``boot_delay`` is not 0, and when it
    was silent. The port is open while any of its devices is.
    """

    def __init__(
        self, link: Link, clock: Clock, *, boot_delay: float = 2.0, report: Report = unreported, name: str = "head"
    ) -> None:
        self._name = name
        self._link = link
        self._clock = clock
        self._boot_delay = boot_delay
        self._report = guarded(report)
        self._lock = RLock()  # over what the devices have sent, whoever makes them send it
        self._devices: tuple[Mounted, ...] = ()  # replaced whole: the link's thread walks through it
        self._session: Session | None = None
        self._past: Counter[str] = Counter()

    @property
    def ready(self) -> bool:
        """True while the board takes angles."""
        session = self._session
        return self._link.online and session is not None and session.topic is not None

    def open(self, device: Mounted) -> None:
        """Serve ``device``; the first one starts the search for the board."""
        if device not in self._devices:
            self._devices += (device,)
        self._link.open(self)

    def close(self, device: Mounted) -> None:
        """Serve ``device`` no more; with the last one, tell the board to stop sending and release the port."""
        self._devices = tuple(each for each in self._devices if each is not device)
        if not self._devices:
            self._link.close()

    def send(self, device: Mounted) -> None:
        """Send what is due for ``device`` now, from whatever thread. Raises NotConnected when the port has gone."""
        with self._lock:
            session = self._session
            if session is not None and session.topic is not None and not session.restarted:
                self._write(session.topic, device.due(self._clock.now()))

    def require(self) -> None:
        """Raise NotConnected, with what is missing and what to try, unless the board takes angles."""
        if not self.ready:
            health = self.health()
            raise NotConnected(health.detail, hint=health.hint)

    def health(self) -> Health:
        """Say whether the board takes angles, and what it is waiting for if not."""
        port, session = self._link.health(), self._session
        counters = Counter(self._past)
        if session is not None:
            counters.update(session.counters())
        figures = {**port.counters, **counters}
        if not port.online or session is None:
            return Health(False, port.detail, port.hint, figures)
        if session.topic is not None:
            return Health(True, counters=figures)
        detail, hint = session.trouble()
        return Health(False, f"{self._name}: {self._link.port}: open, {detail}", hint, figures)

    def wheels(self) -> Reading[WheelRates]:
        """How fast the wheels turn, by the encoders of the later sketches; none with a sketch that has none."""
        session, now = self._session, self._clock.now()
        tacho = None if session is None else session.tacho
        if tacho is None or tacho.value is None:
            return Reading(None, now, Quality.NONE)
        rates = WheelRates(*(rpm * math.tau / 60 for rpm in (tacho.value.left, tacho.value.right)))
        fresh = self._link.online and now - tacho.stamp <= STALE
        return Reading(rates, tacho.stamp, Quality.GOOD if fresh else Quality.STALE)

    # --- the link's thread: see drivers.link.Talker -------------------------------------------------------------------

    def connected(self) -> None:
        """Begin a session with a board that is booting."""
        self._lose()
        before, boot = self._session, self._boot_delay
        if before is not None:
            self._past.update(before.counters())
        restarted = boot > 0 or before is None or before.restarted
        session = Session(
            self._name, wire.SERVO, self._link, self._clock, self._report, boot_delay=boot, restarted=restarted
        )
        if before is not None:
            session.tacho = replace(before.tacho)
        self._session = session

    def received(self, data: bytes) -> None:
        """Pass the board's bytes on."""
        if self._session is not None:
            self._session.received(data)

    def pulse(self) -> None:
        """Let the session do what is due, and every device say what to send."""
        session = self._session
        if session is None:
            return
        session.pulse()
        if session.topic is None:
            self._lose()
            return
        with self._lock:
            now, devices = self._clock.now(), self._devices
            if session.restarted:
                session.restarted = False
                for device in devices:
                    device.restarted()
            self._write(session.topic, [angle for device in devices for angle in device.due(now)])

    def ending(self) -> None:
        """Tell the board to stop sending."""
        self._link.write(wire.STOP_SENDING)

    def _write(self, topic: int, angles: list[wire.ServoAngle]) -> None:
        if angles:
            self._link.write(b"".join(wire.Frame(topic, angle.pack()).pack() for angle in angles))

    def _lose(self) -> None:
        with self._lock:
            for device in self._devices:
                device.lost()
