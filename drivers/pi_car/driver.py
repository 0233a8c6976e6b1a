"""A base whose two motors are in the hands of a keeper: told as shares of full power, and nothing is measured."""

from collections.abc import Callable
from math import inf
from typing import Unpack

from drivers.base.arbitrated import Settings
from drivers.base.plain_base import PlainBase
from drivers.base.reckoning import TwoWheels
from drivers.clock import Clock
from drivers.transport import guardian_wire
from drivers.transport.lines import LineFinder
from drivers.transport.link import Link

PERIOD = 0.02
"""Seconds between two questions: how often the command is renewed."""


class KeeperBase(PlainBase):
    """A ``drivers.api.Base`` over a link that it owns; its pose is dead reckoning.

    ``speed_at_full`` (m/s) is how fast a wheel turns at full power, ``track`` (m) what its wheels turn it by. ``why``
    says why nobody answers, where that is known, and ``cure`` is what to try then.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        *,
        track: float,
        speed_at_full: float,
        why: Callable[[], str] = str,
        cure: str = "",
        **settings: Unpack[Settings],
    ) -> None:
        super().__init__(link, clock, TwoWheels(track, speed_at_full), reckoned=True, **settings)
        self._why, self._cure = why, cure
        self._lines = LineFinder()
        self._boot: int | None = None
        self._asked_at = -inf

    def connected(self) -> None:
        """Begin anew with whoever is there now."""
        self._lines, self._boot = LineFinder(), None
        super().connected()

    def received(self, data: bytes) -> None:
        """Take what the keeper says, and obey."""
        now = self._clock.now()
        for line in self._lines.feed(data):
            try:
                found = guardian_wire.read(line)
            except ValueError:
                self._counters["malformed"] += 1
                continue
            if isinstance(found, guardian_wire.Report):
                if self._boot not in (None, found.boot):
                    self._begun_anew("who holds its motors has begun anew", self._cure)
                self._boot = found.boot
                self._reported(now, None)

    def pulse(self) -> None:
        """Ask again, and renew the command."""
        now = self._clock.now()
        if now - self._asked_at >= PERIOD:
            self._asked_at = now
            self._greet()
        super().pulse()

    def _greet(self) -> None:
        self._link.write(guardian_wire.ASK)

    def _go(self, left: float, right: float) -> None:
        if self._boot is not None:
            full = guardian_wire.FULL / self._wheels.fastest
            self._link.write(guardian_wire.go(self._boot, round(left * full), round(right * full)))

    def _silence(self, now: float) -> tuple[str, str]:  # noqa: ARG002 - it is silent for one reason
        said = self._why() or "open, but nobody who holds its motors answers"
        return f"{self.name}: {self._link.port}: {said}", self._cure
