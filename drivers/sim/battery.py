"""Battery of a simulated base: its charge, and the voltage that the base reports."""

FULL_VOLTAGE, EMPTY_VOLTAGE = 16.5, 13.2
"""Volts of four lithium cells in series at 100 and at 5 percent, as a Kobuki reports them."""

CAPACITY = 2.2 * 3600
"""Charge of a full battery in ampere-seconds: the smaller one of two batteries that the vendor sells."""

INTERNAL_RESISTANCE = 0.15
"""Internal resistance of the battery in ohms. Our assumption for four cells in series."""

CHARGE_CURRENT = 1.5
"""Charging current from the dock in amperes. Our assumption: the vendor promises 1.5 hours for an empty battery."""

_PERCENT_PER_VOLT = 95 / (FULL_VOLTAGE - EMPTY_VOLTAGE)


class Battery:
    """Battery that integrates its charge over the times passed to ``advance``. Not thread-safe.

    ``percent`` (0..100) is the charge and may be set. The battery discharges and charges ``drain`` times as fast as a
    real one; with 0 it never discharges, and charges as fast as a real one. ``resistance`` is in ohms. ``is_charging``
    is updated by ``advance``. Raises ValueError for values out of range.
    """

    def __init__(self, percent: float = 100.0, *, drain: float = 0.0, resistance: float = 0.0) -> None:
        if not 0 <= percent <= 100:
            raise ValueError(f"battery: percent must be from 0 to 100, not {percent}")
        if not (drain >= 0 and resistance >= 0):
            raise ValueError(f"battery: drain and resistance must not be negative, not {drain} and {resistance}")
        self.percent = percent
        self.drain = drain
        self.is_charging = False
        self._resistance = resistance
        self._current = 0.0  # that flow out of it
        self._now: float | None = None

    def advance(self, now: float, current: float, *, docked: bool) -> None:
        """Update the charge until time ``now``: the base draws ``current`` amperes.

        If ``docked``, the dock supplies the base and charges the battery.
        """
        seconds = 0.0 if self._now is None else max(0.0, now - self._now)
        self._now = now
        self.is_charging = docked and self.percent < 100.0
        self._current = -CHARGE_CURRENT if self.is_charging else 0.0 if docked else current
        pace = self.drain or (1.0 if docked else 0.0)
        left = self.percent - 100.0 * self._current * seconds * pace / CAPACITY
        self.percent = min(max(left, 0.0), 100.0)

    @property
    def voltage(self) -> float:
        """Measured battery voltage: linear in the charge as in the vendor's driver, less the drop at the resistance."""
        return EMPTY_VOLTAGE + (self.percent - 5) / _PERCENT_PER_VOLT - self._resistance * self._current

    @property
    def reported_percent(self) -> float:
        """Charge in percent that the vendor's driver computes from the voltage: too low under load."""
        return min(max(self.percent - self._resistance * self._current * _PERCENT_PER_VOLT, 0.0), 100.0)
