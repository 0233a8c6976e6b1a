"""Exposure times from time stamps: they increase, and an impossible stamp is replaced."""

from collections import deque
from collections.abc import Iterable
from math import inf, nextafter, radians

from drivers.api.fast_dataclass import dataclass

MAX_KEPT_AGES, MIN_AGES = 9, 5
"""Number of recent picture ages that are kept, and the number needed for their median."""

MIN_AGE_DROP = 0.1
"""Seconds by which a picture must seem younger on arrival than usual for its stamp to be wrong.

The age of a picture is the time from its stamp to its arrival; the transport itself cannot become so much faster.
"""

MAX_STEP_BACK = 0.03
"""Seconds by which an exposure may precede the previous one; if it precedes it by more, its stamp is wrong.

The jitter of time stamps is smaller.
"""

MIN_DELAY = -0.065
"""Smallest plausible camera delay in seconds.

A picture that is stamped at the start of its exposure of 1/15 s is early by half of that; a pose that is reported 30 ms
late adds to it. More is physically impossible.
"""

MAX_DELAY = 0.25
"""Largest plausible camera delay in seconds: 0.02 before the end of ``perception.delay_grid.GRID``."""

WRONG_STAMP_DOUBT = radians(10)
"""Doubt about the direction of the camera for a picture with a wrong stamp: radians, one sigma."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """Time of an exposure in seconds. ``stamp`` increases from picture to picture; ``doubt`` is in radians."""

    time: float
    stamp: float
    doubt: float = 0.0


class ExposureClock:
    """Converts time stamps of pictures to exposure times, in the order of the pictures."""

    def __init__(self) -> None:
        self._last_stamp = -inf
        self._ages: deque[float] = deque(maxlen=MAX_KEPT_AGES)

    def expose(self, stamp: float, delay: float, now: float | None) -> Exposure:
        """Return the exposure of a picture with the time stamp ``stamp``, which is ``delay`` seconds late.

        ``now`` is the time at which the picture arrived. It reveals a stamp that lies in the future; the exposure is
        then computed from ``now``, since exposures must increase and all later ones would have to wait for that stamp.
        """
        time, wrong = stamp - delay, False
        if now is not None:
            usual = _median(self._ages) if len(self._ages) >= MIN_AGES else -inf
            self._ages.append(now - stamp)
            if now - stamp < usual - MIN_AGE_DROP:
                time, wrong = now - usual - delay, True
        wrong = wrong or time < self._last_stamp - MAX_STEP_BACK
        self._last_stamp = max(time, nextafter(self._last_stamp, inf))
        return Exposure(time, self._last_stamp, WRONG_STAMP_DOUBT if wrong else 0.0)


def _median(values: Iterable[float]) -> float:
    """Return the median. ``statistics`` would import ``decimal`` and ``fractions`` at each start."""
    ordered = sorted(values)
    half = len(ordered) // 2
    return (ordered[half] + ordered[~half]) / 2
