"""How well joints followed a motion: where each should have been, where it was measured, and how far it was off."""

import math
from collections.abc import Iterable, Mapping, Sequence

from drivers.api import Angle, Duration
from drivers.api.quick import dataclass


@dataclass(frozen=True, slots=True)
class Sample:
    """Where a joint should have been, and was (radians), ``time`` seconds after the motion began."""

    time: float
    joint: str
    goal: float
    position: float

    @property
    def error(self) -> float:
        """How far beyond its goal it was, in radians."""
        return self.position - self.goal


@dataclass(frozen=True, slots=True)
class JointError:
    """How far a joint was off over a whole motion, in radians: ``rms`` the root of the mean square, ``worst`` the most.

    ``at`` is when that was, in seconds after the motion began; ``readings`` how often it was measured.
    """

    rms: Angle
    worst: Angle
    at: Duration
    readings: int


class Tracking:
    """Gathers what is measured during one motion. ``samples`` are all of it, in the order in which they came."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._newest: dict[str, float] = {}

    def take(self, samples: Iterable[Sample]) -> None:
        """Take in those that are new: a reading that is asked for twice was measured once."""
        for sample in samples:
            if sample.time > self._newest.get(sample.joint, -math.inf):
                self._newest[sample.joint] = sample.time
                self.samples.append(sample)

    def errors(self) -> Mapping[str, JointError]:
        """Return how far off each joint was; a joint that was never measured is left out."""
        by_joint: dict[str, list[Sample]] = {}
        for sample in self.samples:
            by_joint.setdefault(sample.joint, []).append(sample)
        return {joint: _error(samples) for joint, samples in by_joint.items()}


def _error(samples: Sequence[Sample]) -> JointError:
    worst = max(samples, key=lambda sample: abs(sample.error))
    rms = math.sqrt(math.fsum(sample.error**2 for sample in samples) / len(samples))
    return JointError(rms, abs(worst.error), worst.time, len(samples))
