"""The battery of a simulated base: what is left in it, and the voltage that the base reports."""

FULL_VOLTAGE, EMPTY_VOLTAGE = 16.5, 13.2
"""Volts of four lithium cells in series at 100 and at 5 percent, as a Kobuki reports them."""

CAPACITY = 2.2 * 3600
"""Ampere-seconds in a full one: the smaller of the vendor's two."""

INTERNAL_RESISTANCE = 0.15
"""Ohms within, by which its voltage drops under load: our assumption for four cells in a row."""

CHARGE_CURRENT = 1.5
"""Amperes from the dock: our assumption; it fills an empty battery in an hour and a half, as the vendor promises."""

_PERCENT_PER_VOLT = 95 / (FULL_VOLTAGE - EMPTY_VOLTAGE)


class Battery:
    """Keeps count of the charge; its time is handed in. Not safe between threads.

    ``percent`` (0..100) is what is left, and may be set. ``drain`` is how many times as fast as a real one it empties,
    and fills: with 0, which is what nobody has to think of, it keeps what it has, and fills as fast as a real one.
    ``resistance`` in ohms is what makes its voltage drop under load. ``is_charging`` is as of the last ``advance``.
    Raises ValueError for values that make no sense.
    """

    def __init__(self, percent: float = 100.0, *, drain: float = 0.0, resistance: float = 0.0) -> None:
        if not (0 <= percent <= 100 and drain >= 0 and resistance >= 0):
            raise ValueError(f"battery: {percent=}, {drain=}, {resistance=}: out of range")
        self.percent = percent
        self.drain = drain
        self.is_charging = False
        self._resistance = resistance
        self._current = 0.0  # that flow out of it
        self._now: float | None = None

    def advance(self, now: float, current: float, *, docked: bool) -> None:
        """Let the base draw ``amperes`` until time ``now``, from the dock if it stands there."""
        seconds = 0.0 if self._now is None else max(0.0, now - self._now)
        self._now = now
        self.is_charging = docked and self.percent < 100.0
        self._current = -CHARGE_CURRENT if self.is_charging else 0.0 if docked else current
        pace = self.drain or (1.0 if docked else 0.0)
        left = self.percent - 100.0 * self._current * seconds * pace / CAPACITY
        self.percent = min(max(left, 0.0), 100.0)

    @property
    def voltage(self) -> float:
        """What the base measures: by the line of the vendor's driver, less what is lost on the way out."""
        return EMPTY_VOLTAGE + (self.percent - 5) / _PERCENT_PER_VOLT - self._resistance * self._current

    @property
    def reported_percent(self) -> float:
        """The percent that the vendor's driver makes of that voltage: too few under load."""
        return min(max(self.percent - self._resistance * self._current * _PERCENT_PER_VOLT, 0.0), 100.0)
