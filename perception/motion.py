"""How one angle moves: a Kalman filter with a constant rate, for measurements at any times.

After Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", section 6.3: the
piecewise constant acceleration model, with two states. How exactly angles are measured is learnt.
Somebody who sets off, stops or turns about is known by how far he is from where he was expected (section 11.2:
adjustable process noise).
"""

from math import radians, sqrt

from perception.geometry import wrap

MEASURED = radians(0.4)
"""Standard deviation of a measured angle, until it is learnt: two or three pixels of 640 over 60 degrees."""

LEAST = radians(0.1)
"""The least that it is taken for."""

BELIEVED, REMEMBERED = 3, 20
"""For how many measurements that counts which is believed before any, and how many are remembered."""

TURNED = 0.4
"""Standard deviation of an angle as a share of what the camera has turned since the measurement before: servos stand
beside the way that they are sent, and when a picture was taken is known to some ten milliseconds."""

STANDS, FADES = radians(0.1), 0.5
"""Radians: a camera that has turned less stands; by and by, as the second number says."""

ACCELERATION = 2.0
"""Standard deviation in rad/s^2 of how the rate changes: someone who walks at 20 degrees/s turns about in 0.35 s."""

FIRST_RATE = 1.0
"""Standard deviation in rad/s of the rate before a second measurement, and of one that has become another."""

JUMP = radians(4), radians(100)
"""What is farther than so many radians, and rad/s, from where it was expected has jumped, unless it was known so badly
that this is within ``UNSURE`` standard deviations. It begins anew there: a jump tells no rate."""

UNSURE = 3.0

SUDDEN = 3.0
"""Standard deviations: who is farther from where he was expected, before a camera that stands, has another rate now."""


class Motion:
    """The filtered ``angle`` in radians and ``rate`` in rad/s at the last measurement. The angle does not wrap."""

    def __init__(self, angle: float) -> None:
        self._noise, self._count = MEASURED**2, BELIEVED
        self._turned = 0.0
        self._begin(angle)

    def _begin(self, angle: float) -> None:
        """Know where it is, and nothing of its rate."""
        self.angle = angle
        self.rate = 0.0
        self._angle_variance = self._noise
        self._covariance = 0.0
        self._rate_variance = FIRST_RATE**2
        self._seen = [(angle, 0.0)]

    def update(self, angle: float, after: float, turned: float = 0.0) -> None:
        """Take in an angle measured ``after`` seconds, whole turns aside; the camera ``turned`` (radians) meanwhile.

        Raises ValueError for a negative time.
        """
        if after < 0:
            raise ValueError(f"motion: a measurement cannot come {-after} s before the last one")
        self._go_on(after)
        surprise = wrap(angle - self.angle)
        turned = self._turned = max(turned, FADES * self._turned)
        noise = self._noise + (TURNED * turned) ** 2
        expected = sqrt(self._angle_variance + noise)
        if abs(surprise) > max(JUMP[0], JUMP[1] * after, UNSURE * expected):
            self._begin(self.angle + surprise)
            return
        self._learn(self.angle + surprise, after, turned)
        if turned < STANDS and abs(surprise) > SUDDEN * expected:
            self._spread(after, FIRST_RATE**2)
        variance = self._angle_variance + noise
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

    def _spread(self, after: float, more: float) -> None:
        """The rate became less certain ``after`` seconds ago, by a variance of so much ``more``."""
        self._angle_variance += after**2 * more
        self._covariance += after * more
        self._rate_variance += more

    def _learn(self, angle: float, after: float, turned: float) -> None:
        """Learn how exactly angles are measured: by how far the middle one of three is off the line of the others."""
        if after <= 0.0 or turned > STANDS:
            self._seen = [(angle, after)]
            return
        if len(self._seen) == 2:
            (first, _), (middle, time) = self._seen
            share = time / (time + after)
            off = (middle - first - share * (angle - first)) ** 2 / (1 + share**2 + (1 - share) ** 2)
            self._count = min(self._count + 1, REMEMBERED)
            self._noise = max(LEAST**2, self._noise + (min(off, 9 * self._noise) - self._noise) / self._count)
        self._seen = [self._seen[-1], (angle, after)]
