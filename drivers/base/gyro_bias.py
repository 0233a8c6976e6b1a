"""The bias of a gyro, learnt while the base is known to stand still. Time is handed in as intervals.

A raw rate is never taken for standing or turning: only whether it changes, and what is left of it without the bias.
A bias that is learnt in a slow turn makes the heading drift afterwards (pybricks/support#1840). So the bias is learnt
only while nothing is commanded and the encoders stand still. Where no encoders are reported, an even rate has to do:
then a slow turn by somebody else looks the same until the bias is known, and is told apart from it afterwards.
"""

SETTLED = 0.3
"""Seconds of standing still, of command and encoders, after which it learns."""

LEARNT = 0.5
"""Seconds of standing still after which the bias is known well enough to turn by."""

SETTLING_LIMIT = 3.0
"""Seconds of standing after which nobody waits any longer for a bias that cannot be learnt."""

GATE = 0.12
"""rad/s beside the bias from which on a base truly turns, though its encoders stand still: somebody has lifted it."""

KNOWN_AFTER, KNOWN_GATE = 2.0, 0.02
"""Seconds of learning after which a base without encoders counts as turning from so many rad/s beside the bias on."""

RELEARN_AFTER = 60.0
"""Seconds of an even rate beside a known bias after which that rate is the bias: nobody turns a base so long."""

DRIFTS = 0.01
"""rad/s from which on a rate at rest is worth waiting for the bias to be known."""

MEMORY = 2.0
"""Seconds over which the bias is averaged once it is known: a bias follows the temperature."""

STEADY = 0.02
"""rad/s by which the reported rate of a base without encoders may change while it counts as standing."""

SPAN, EVEN, ROUGH = 1.0, 0.005, 3
"""Seconds whose mean rates may differ by so many rad/s while a noisy or rounded rate counts as even: one that is not
steady so many times within these seconds."""

SMOOTHING = 0.2
"""Seconds over which turns are averaged: messages that arrive in pairs tell no rate one by one."""


class GyroBias:
    """Corrects turns and rates of a gyro. Without ``encoders``, a base stands only while its rate is even."""

    def __init__(self, *, encoders: bool = True) -> None:
        self.rate = 0.0
        """The bias, in rad/s."""
        self.settling = False
        """True while it stands with a rate that may be a bias, which is not known yet; ``SETTLING_LIMIT`` at most."""
        self._encoders = encoders
        self._learnt_for = 0.0
        self._stood_for = 0.0  # whether its rate is even or not
        self._still_for = 0.0
        self._beside_for = 0.0  # with an even rate that differs from the known bias
        self._before: float | None = None
        self._mean = 0.0
        self._even = False  # though it is not steady from sample to sample
        self._span = (0.0, 0.0, 0)  # turn in rad, seconds, and how often the rate was not steady
        self._span_before: float | None = None  # the mean rate of the span before

    def correct(self, turn: float, rate: float, seconds: float, *, still: bool) -> tuple[float, float]:
        """Return ``turn`` (rad) within ``seconds``, and ``rate`` (rad/s), without the bias; both 0 at rest.

        ``still`` says that nothing is commanded and no encoder counts.
        """
        if seconds <= 0.0:
            return turn, rate - self.rate
        before, self._before = self._before, rate
        steady = self._encoders or (before is not None and abs(rate - before) < STEADY)
        if still:
            self._stand(turn, seconds, steady=steady)
        else:
            self._restart()
        self._still_for = self._still_for + seconds if still and (steady or self._even) else 0.0
        waits = still and self._still_for < LEARNT and self._stood_for < SETTLING_LIMIT
        self.settling = waits and DRIFTS < abs(rate - self.rate) < GATE
        measured = turn / seconds
        if not self._rests(measured, rate, seconds):
            return turn - self.rate * seconds, rate - self.rate
        self._learnt_for += seconds
        self.rate += min(max(seconds / self._learnt_for, seconds / MEMORY), 1.0) * (measured - self.rate)
        return 0.0, 0.0

    def _stand(self, turn: float, seconds: float, *, steady: bool) -> None:
        """Average the turns of a base that is told to stand."""
        share = min(seconds / SMOOTHING, 1.0) if self._stood_for else 1.0
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
        """Begin to average anew: the base moves."""
        self._stood_for = 0.0
        self._span, self._even = (0.0, 0.0, 0), False
        self._span_before = None

    def _rests(self, measured: float, rate: float, seconds: float) -> bool:
        """Return whether all that is measured is the bias."""
        if self._still_for < SETTLED:
            self._beside_for = 0.0
            return False
        if self._encoders:
            return abs(measured - self.rate) < GATE
        beside = abs(self._mean - self.rate)
        if not self._even:
            beside = max(beside, abs(rate - self.rate))
        known = self._learnt_for >= KNOWN_AFTER
        if beside < (KNOWN_GATE if known else GATE):
            self._beside_for = 0.0
            return True
        self._beside_for += seconds
        if self._beside_for >= RELEARN_AFTER and beside < GATE:
            self._learnt_for = self._beside_for = 0.0
        return False
