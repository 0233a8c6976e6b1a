"""Simulated range finder: publishes a scan of the simulated world after each full turn, with realistic noise."""

from collections.abc import Callable, Sequence
from math import inf

import numpy as np

from drivers.api import Health, Quality, Ranges, RangeScan, Reading, StatusCallback, ignore
from drivers.base.scan_mounting import START, STEP, Mounting, Place, Sector, bearings
from drivers.clock import Clock
from drivers.sim.plug import SimulatedPlug
from drivers.sim.scanner import RangeFunction
from drivers.transport.loop import guard_callback

STALE_AFTER = 0.5
"""Seconds after the end of the latest scan after which it is stale, because the next one is missing."""

NOISE = 0.01
"""Standard deviation of a distance measured by an RPLIDAR A1, as a share of the distance."""


class RangerTwin:
    """Simulated range finder: a ``drivers.api.Ranger``. Call ``step`` every ``STEP_INTERVAL``; not thread-safe.

    All beams of a turn are measured at once, in the middle of the turn. ``look`` returns the distances at given
    bearings. Each distance has an error of the standard deviation ``noise``, as a share of it. A beam has no echo with
    the probability ``dropouts`` (0..1). ``seed`` seeds both. The measuring range is ``least`` to ``most`` metres,
    ``rate`` is in turns per second; the defaults are those of an RPLIDAR A1. ``place`` and ``blind`` are as in
    ``drivers.base.scan_mounting.Mounting``. Raises ValueError for values out of range.
    """

    name = "range"

    def __init__(
        self,
        look: RangeFunction,
        clock: Clock,
        *,
        least: float = 0.15,
        most: float = 12.0,
        rate: float = 5.5,
        place: Place = (0.0, 0.0, 0.0),
        blind: Sequence[Sector] = (),
        report: StatusCallback = ignore,
        changed: Callable[[], None] = ignore,
        noise: float = NOISE,
        dropouts: float = 0.0,
        seed: int = 0,
    ) -> None:
        if not (0 <= least < most and rate > 0 and 0 <= dropouts <= 1 and 0 <= noise < inf):
            raise ValueError(f"{self.name}: {least=}, {most=}, {rate=}, {dropouts=}, {noise=}: out of range")
        self.plug = SimulatedPlug(self.name, report, on_online=self._begin)
        self._least, self._most = least, most
        self.STEP_INTERVAL = 0.5 / rate
        """Seconds between two steps: half a turn."""
        self._mounting = Mounting(place, tuple(blind))
        self._bearings = bearings()
        self._look = look
        self._clock = clock
        self._changed = guard_callback(changed)
        self._noise = noise
        self._dropouts = dropouts
        self._random = np.random.default_rng([seed, *self.name.encode()])
        self._measured: RangeScan | None = None  # in the middle of the turn that goes on
        self._latest: RangeScan | None = None
        self._turned_at = -inf
        self._number = 0

    @property
    def place(self) -> Place:
        """Mounting pose on the base: x forward and y left in metres, yaw in radians."""
        return self._mounting.place

    def scan(self) -> Reading[RangeScan]:
        """Return the latest complete turn; it is stale ``STALE_AFTER`` seconds after its end."""
        now = self._clock.now()
        if self._latest is None:
            return Reading(None, now, Quality.NONE)
        fresh = now - self._turned_at <= STALE_AFTER
        return Reading(self._latest, self._latest.stamp, Quality.GOOD if fresh else Quality.STALE)

    def open(self) -> None:
        """Connect at once, unless the simulated plug is pulled. The first scan is complete one turn later."""
        self.plug.open()

    def rest(self) -> None:
        """Do nothing: a range finder has no actuator."""

    def close(self) -> None:
        """End the measurements. Safe from any state, more than once."""
        self.plug.close()

    def health(self) -> Health:
        """Return whether complete turns arrive, as the real driver does."""
        health = self.plug.health({"turns": self._number})
        if health.online and self._turned_at == -inf:
            return Health(False, f"{self.name}: waiting for the first complete turn", "", health.counters)
        return health

    def step(self) -> None:
        """Advance by half a turn. Calls alternate: one measures a scan, the next one publishes it."""
        if not self.plug.online:
            return
        now = self._clock.now()
        if self._measured is None:
            self._measured = RangeScan(self._ranges(now), START, STEP, now, self._number, self._least, self._most)
            return
        self._latest, self._measured = self._measured, None
        self._number += 1
        self._turned_at = now
        self._changed()

    def _begin(self) -> None:
        """Drop the scan that was measured but not published yet."""
        self._measured, self._turned_at = None, -inf

    def _ranges(self, now: float) -> Ranges:
        far = self._look(self._bearings, now)
        if self._noise:
            far = far * (1 + self._noise * self._random.standard_normal(len(far)))
        lost = self._mounting.hidden | ~((far >= self._least) & (far <= self._most))
        if self._dropouts:
            lost = lost | (self._random.random(len(far)) < self._dropouts)
        return np.where(lost, np.nan, far).astype(np.float32)
