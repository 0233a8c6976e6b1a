"""Bias of a gyro, learnt while the base is at rest.

A constant rate of the gyro may be its bias or a slow turn. A bias that is learnt during a slow turn makes the heading
drift afterwards (pybricks/support#1840). Therefore the bias is learnt only while the base is not commanded and its
encoders report no motion. If the base has no encoders, the rate must be steady instead. A slow turn by hand is mistaken
for the bias only as long as no bias is known.
"""

MIN_STILL_TIME = 0.3
"""Seconds at rest, by command and encoders, after which the bias of the gyro is learnt."""

MIN_LEARNING_TIME = 0.5
"""Seconds at rest after which the learnt bias of the gyro is accurate enough for a leaf to start a turn."""

MAX_SETTLING_TIME = 3.0
"""Maximum seconds at rest for which leaves wait for the bias of a gyro whose rate is not steady."""

MAX_BIAS_CHANGE = 0.12
"""Deviation of the rate from the bias in rad/s above which a base turns although its encoders report no motion.

Such a base is turned by hand, off the floor.
"""

KNOWN_AFTER, KNOWN_GATE = 2.0, 0.02
"""Seconds of learning after which a base without encoders turns if its rate deviates by so many rad/s."""

RELEARN_AFTER = 60.0
"""Seconds of a steady rate that differs from the known bias, after which the bias is learnt again.

No turn lasts this long, so the bias has changed.
"""

MAX_DRIFT = 0.01
"""Turn rate of a gyro at rest in rad/s above which leaves wait until its bias is known."""

AVERAGING_TIME = 2.0
"""Time constant in seconds with which a known gyro bias is updated, since the bias changes with the temperature."""

MAX_RATE_CHANGE = 0.02
"""Maximum change in rad/s between two reports of a gyro whose rate counts as steady, on a base without encoders."""

SPAN, EVEN, ROUGH = 1.0, 0.005, 3
"""Length of a span in seconds, difference of the means of two spans in rad/s up to which a noisy or rounded rate is
even, and the number of unsteady reports in a span that make a rate noisy."""

SMOOTHING_TIME = 0.2
"""Time constant in seconds of the mean rate of a gyro. Averaging is needed for reports that arrive in pairs."""


class GyroBias:
    """Removes the bias from turns and rates of a gyro, and learns the bias while the base is at rest.

    ``encoders`` is False for a base without wheel encoders; it counts as at rest only while the rate of the gyro is
    steady.
    """

    def __init__(self, *, encoders: bool = True) -> None:
        self.rate = 0.0
        """Bias in rad/s."""
        self.settling = False
        """True while leaves must wait at rest because the bias is not known yet, for ``MAX_SETTLING_TIME`` at most."""
        self._encoders = encoders
        self._learnt_for = 0.0
        self._stood_for = 0.0  # with an even rate or not
        self._still_for = 0.0
        self._beside_for = 0.0  # with an even rate that differs from the known bias
        self._before: float | None = None
        self._mean = 0.0
        self._even = False  # although it changes from report to report
        self._span = (0.0, 0.0, 0)  # turn in rad, seconds, number of unsteady reports
        self._span_before: float | None = None  # the mean rate of the span before

    def correct(self, turn: float, rate: float, seconds: float, *, still: bool) -> tuple[float, float]:
        """Return ``turn`` (rad) within ``seconds`` and ``rate`` (rad/s) without the bias; both are 0 at rest.

        ``still`` is True if the base is not commanded and its encoders report no motion.
        """
        if seconds <= 0.0:
            return turn, rate - self.rate
        before, self._before = self._before, rate
        steady = self._encoders or (before is not None and abs(rate - before) < MAX_RATE_CHANGE)
        if still:
            self._stand(turn, seconds, steady=steady)
        else:
            self._restart()
        self._still_for = self._still_for + seconds if still and (steady or self._even) else 0.0
        waits = still and self._still_for < MIN_LEARNING_TIME and self._stood_for < MAX_SETTLING_TIME
        self.settling = waits and MAX_DRIFT < abs(rate - self.rate) < MAX_BIAS_CHANGE
        measured = turn / seconds
        if not self._rests(measured, rate, seconds):
            return turn - self.rate * seconds, rate - self.rate
        self._learnt_for += seconds
        self.rate += min(max(seconds / self._learnt_for, seconds / AVERAGING_TIME), 1.0) * (measured - self.rate)
        return 0.0, 0.0

    def _stand(self, turn: float, seconds: float, *, steady: bool) -> None:
        """Add a turn in rad within ``seconds`` to the averages of a base that is not commanded.

        ``steady`` is False if the rate has changed since the last report.
        """
        share = min(seconds / SMOOTHING_TIME, 1.0) if self._stood_for else 1.0
        self._mean += share * (turn / seconds - self._mean)
        self._stood_for += seconds
        turned, passed, jumps = self._span
        self._span = turned, passed, jumps = turned + turn, passed + seconds, jumps + (not steady)
        if passed >= SPAN:
            mean, self._span = turned / passed, (0.0, 0.0, 0)
            agree = self._span_before is not None and abs(mean - self._span_before) < EVEN
            self._even = agree and jumps >= ROUGH
            self._span_before = mean

    def _restart(self) -> None:
        self._stood_for = 0.0
        self._span, self._even = (0.0, 0.0, 0), False
        self._span_before = None

    def _rests(self, measured: float, rate: float, seconds: float) -> bool:
        """Return whether the base is at rest, so that the ``measured`` rate (rad/s) is the bias of the gyro."""
        if self._still_for < MIN_STILL_TIME:
            self._beside_for = 0.0
            return False
        if self._encoders:
            return abs(measured - self.rate) < MAX_BIAS_CHANGE
        beside = abs(self._mean - self.rate)
        if not self._even:
            beside = max(beside, abs(rate - self.rate))
        known = self._learnt_for >= KNOWN_AFTER
        if beside < (KNOWN_GATE if known else MAX_BIAS_CHANGE):
            self._beside_for = 0.0
            return True
        self._beside_for += seconds
        if self._beside_for >= RELEARN_AFTER and beside < MAX_BIAS_CHANGE:
            self._learnt_for = self._beside_for = 0.0
        return False
