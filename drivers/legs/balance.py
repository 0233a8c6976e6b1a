"""Balance of a walk by what is felt of the trunk: ankles first, then the hips, then a step to where it can be caught.

The trunk is taken for the top of an inverted pendulum: leaning by an angle from where the walk has it, the centre of
mass is that far off, and its capture point farther by how fast the lean grows. A small error the ankles push back, as
far as the soles reach; of a larger one the hips take a share; the next foot lands as far off as the capture point will
be by then.
"""

from dataclasses import dataclass

from drivers.legs.declared import StrideKeys
from drivers.legs.engine import Correction, Felt, Posture
from drivers.legs.pendulum import rate

DEAD = 0.012
"""Metres of capture error that soles take by themselves."""


@dataclass(frozen=True, slots=True)
class Gains:
    """How much balance does: ``ankle`` and ``hip`` per radian of lean, ``damping`` per rad/s, ``step`` of the error.

    In physics the ankles kept walks up that fell without them; steps have not been seen to help yet, and are off.
    """

    ankle: float = 0.3
    damping: float = 0.02
    hip: float = 0.0
    step: float = 0.0
    most_ankle: float = 0.1
    most_hip: float = 0.15


class Balance:
    """Says what is to be added to a walk. ``com_height`` is that of the centre of mass in metres."""

    def __init__(self, stride: StrideKeys, com_height: float, gains: Gains = Gains()) -> None:
        self._gains, self._lean = gains, stride.lean
        self._height, self._rate = com_height, rate(com_height)
        self._longest, self._widest = stride.longest / 2, stride.widest

    def __call__(self, felt: Felt, posture: Posture) -> Correction:  # noqa: ARG002 - see drivers.legs.engine.Balance
        """Return the correction for what is felt in a posture."""
        gains = self._gains
        lean, rates = (felt.roll, felt.pitch - self._lean), (felt.roll_rate, felt.pitch_rate)
        pushed = [gains.ankle * angle + gains.damping * speed for angle, speed in zip(lean, rates, strict=True)]
        ankle = [_within(angle, gains.most_ankle) for angle in pushed]
        hip = [_within(-gains.hip * angle, gains.most_hip) for angle in lean]
        # A lean ahead carries the body ahead; a lean to the right, which is above 0, to the right.
        ahead = self._error(lean[1], rates[1])
        left = -self._error(lean[0], rates[0])
        step = (_within(gains.step * ahead, self._longest), _within(gains.step * left, self._widest))
        return Correction((hip[0], hip[1]), (ankle[0], ankle[1]), step)

    def _error(self, lean: float, speed: float) -> float:
        """Return how far (m) the capture point is off, beyond what soles take by themselves."""
        error = self._height * (lean + speed / self._rate)
        return error - _within(error, DEAD)


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)
