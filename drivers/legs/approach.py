"""The way of legs from where they are found to where a walk begins: slow, and smooth at both ends."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import radians

import numpy as np

from drivers.api import JointState, Reading
from drivers.legs.body import Floats

NEAR = radians(6)
"""How far a joint may be from where a walk begins, to begin at once."""

FAR = radians(62)
"""How far it may be to be brought there at all: who sits or lies has to stand first."""

GENTLE = radians(35)
"""rad/s that joints take on the way there at most."""

SHORTEST = 0.5
"""Seconds that it takes at least."""


@dataclass(frozen=True, slots=True)
class Approach:
    """From ``start`` (12,) to ``end``, between two times in seconds."""

    start: Floats
    end: Floats
    since: float
    until: float

    @classmethod
    def begun(cls, start: Floats, end: Floats, now: float) -> "Approach":
        """Return the way from time ``now`` on."""
        far = float(np.abs(end - start).max())
        return cls(start, end, now, now + max(SHORTEST, 1.5 * far / GENTLE))

    def share(self, now: float) -> float:
        """Return how much of its time is over, 0..1."""
        return min(1.0, (now - self.since) / (self.until - self.since))

    def at(self, now: float) -> Floats:
        """Return where the joints are to be."""
        share = self.share(now)
        goals: Floats = self.start + share * share * (3 - 2 * share) * (self.end - self.start)
        return goals


def away_from(ready: Floats, names: Iterable[str], states: Mapping[str, Reading[JointState]]) -> dict[str, float]:
    """Return how far joints that were heard of are from where a walk begins, rad; ``ready`` is that, as ``names``."""
    places = zip(names, ready.tolist(), strict=True)
    return {name: value.position - angle for name, angle in places if (value := states[name].value) is not None}


def is_near(ready: Floats, names: Iterable[str], states: Mapping[str, Reading[JointState]]) -> bool:
    """Whether a walk can begin at once from where joints are; see ``away_from``."""
    return max(map(abs, away_from(ready, names, states).values())) < NEAR
