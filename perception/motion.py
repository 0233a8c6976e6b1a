"""How one angle moves: a Kalman filter with a constant rate, for measurements at any times.

After Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", section 6.3: the
piecewise constant acceleration model, with two states.
"""

from math import radians, sqrt

from perception.geometry import wrap

MEASURED = radians(0.4)
"""Standard deviation of a measured angle: two or three pixels of 640 over 60 degrees."""

ACCELERATION = 2.0
"""Standard deviation in rad/s^2 of how the rate changes: someone who walks at 20 degrees/s turns about in 0.35 s."""

FIRST_RATE = 1.0
"""Standard deviation in rad/s of the rate before a second measurement."""

JUMP = radians(4), radians(100)
"""What is farther than so many radians, and rad/s, from where it was expected has jumped, unless it was known so badly
that this is within ``UNSURE`` standard deviations. It begins anew there: a jump tells no rate."""

UNSURE = 3.0


class Motion:
    """The filtered ``angle`` in radians and ``rate`` in rad/s at the last measurement. The angle does not wrap."""

    def __init__(self, angle: float) -> None:
        self._begin(angle)

    def _begin(self, angle: float) -> None:
        """Know where it is, and nothing of its rate."""
        self.angle = angle
        self.rate = 0.0
        self._angle_variance = MEASURED**2
        self._covariance = 0.0
        self._rate_variance = FIRST_RATE**2

    def update(self, angle: float, after: float) -> None:
        """Take in an angle measured ``after`` seconds, whole turns aside. Raises ValueError for a negative time."""
        if after < 0:
            raise ValueError(f"motion: a measurement cannot come {-after} s before the last one")
        self._go_on(after)
        surprise = wrap(angle - self.angle)
        variance = self._angle_variance + MEASURED**2
        if abs(surprise) > max(JUMP[0], JUMP[1] * after, UNSURE * sqrt(variance)):
            self._begin(self.angle + surprise)
            return
        gain, rate_gain = self._angle_variance / variance, self._covariance / variance
        self.angle += gain * surprise
        self.rate += rate_gain * surprise
        self._rate_variance -= rate_gain * self._covariance
        self._covariance *= 1 - gain
        self._angle_variance *= 1 - gain

    def _go_on(self, after: float) -> None:
        """Predict: the angle moves on at its rate, and both become less certain."""
        jolt = (ACCELERATION * after) ** 2
        self.angle += self.rate * after
        self._angle_variance += after * (2 * self._covariance + after * self._rate_variance) + jolt * after**2 / 4
        self._covariance += after * self._rate_variance + jolt * after / 2
        self._rate_variance += jolt
