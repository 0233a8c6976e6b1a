"""The bias of a gyro, learnt while the base is known to stand still. Time is handed in as intervals.

A raw rate is never taken for standing or turning: only whether it changes, and what is left of it without the bias.
What is learnt while the base turns slowly would make its heading drift afterwards (pybricks/support#1840); so it learns
only while nothing is commanded and the encoders stand still.
"""

SETTLED = 0.3
"""Seconds of standing still, of command and encoders, after which it learns."""

LEARNT = 0.5
"""Seconds of standing still after which the bias is known well enough to turn by."""

GATE = 0.12
"""rad/s beside the bias from which on a base truly turns, though its encoders stand still: somebody has lifted it."""

DRIFTS = 0.01
"""rad/s from which on a rate at rest is worth waiting for the bias to be known."""

MIN_WEIGHT = 0.01
"""Weight of a new sample once many have been averaged: a bias follows the temperature."""

STEADY = 0.02
"""rad/s by which the rate of a base without encoders may change while it counts as standing."""


class GyroBias:
    """Corrects turns and rates of a gyro. Without ``encoders``, a base stands only while its rate is steady."""

    def __init__(self, *, encoders: bool = True) -> None:
        self.rate = 0.0
        """The bias, in rad/s."""
        self.settling = False
        """True while it stands with a rate that may be a bias, which is not known yet."""
        self._encoders = encoders
        self._samples = 0
        self._still_for = 0.0
        self._before: float | None = None

    def correct(self, turn: float, rate: float, seconds: float, *, still: bool) -> tuple[float, float]:
        """Return ``turn`` (rad) within ``seconds``, and ``rate`` (rad/s), without the bias; both 0 at rest.

        ``still`` says that nothing is commanded and no encoder counts.
        """
        if seconds <= 0.0:
            return turn, rate - self.rate
        measured = turn / seconds
        before, self._before = self._before, measured
        steady = self._encoders or (before is not None and abs(measured - before) < STEADY)
        self._still_for = self._still_for + seconds if still and steady else 0.0
        rests = self._still_for >= SETTLED and abs(measured - self.rate) < GATE
        self.settling = still and self._still_for < LEARNT and DRIFTS < abs(rate - self.rate) < GATE
        if not rests:
            return turn - self.rate * seconds, rate - self.rate
        self._samples += 1
        self.rate += max(1 / self._samples, MIN_WEIGHT) * (measured - self.rate)
        return 0.0, 0.0
