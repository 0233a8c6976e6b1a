"""When a battery counts as low, and as critical: not for a dip, and not while it charges."""

from math import inf

CONFIRM = 2.0
"""Seconds between two readings that have to agree: under load the voltage dips, and the percentage with it."""

HYSTERESIS = 3.0
"""Percent above a threshold from which on it does not hold any more."""


class BatteryWatch:
    """Looks at readings of a battery; ``low`` and ``critical`` say how it is as of the last one.

    Thresholds are in percent, 0 for never. Either holds once two readings at least ``CONFIRM`` apart were below it, and
    none between was above, until the battery charges or is ``HYSTERESIS`` above it.
    """

    def __init__(self, low: float, critical: float) -> None:
        self._low, self._critical = _Threshold(low), _Threshold(critical)
        self._plenty = max(low, critical) + HYSTERESIS
        self._uneasy = False  # below that when it was last looked at

    @property
    def low(self) -> bool:
        """True when it should be charged soon."""
        return self._low.holds

    @property
    def critical(self) -> bool:
        """True when nothing should be begun with it any more."""
        return self._critical.holds

    def update(self, percent: float, now: float, *, charging: bool) -> bool:
        """Take in a reading (0..100) of time ``now`` in seconds; False where there was and is plenty: nothing holds."""
        percent = inf if charging else percent
        if not self._uneasy and percent >= self._plenty:
            return False
        self._uneasy = percent < self._plenty
        self._low.update(percent, now)
        self._critical.update(percent, now)
        return True


class _Threshold:
    """One of the two."""

    def __init__(self, percent: float) -> None:
        self._percent = percent
        self._below_since: float | None = None
        self.holds = False

    def update(self, percent: float, now: float) -> None:
        if percent >= self._percent:
            self._below_since = None
            self.holds = self.holds and percent < self._percent + HYSTERESIS
        elif self._below_since is None:
            self._below_since = now
        elif now - self._below_since >= CONFIRM:
            self.holds = True
