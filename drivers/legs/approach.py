"""The way of legs from where they are found to a stand or a sit: slow, smooth, and over the soles where it can be."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import radians

import numpy as np
import numpy.typing as npt

from drivers.api import JointLimits, JointState, Reading
from drivers.errors import BadRequest
from drivers.legs.body import Body, Floats
from drivers.legs.declared import StrideKeys
from drivers.legs.engine import manner_of, stands

NEAR = radians(6)
"""How far a joint may be from where a walk begins, to begin at once."""

FAR = radians(62)
"""How far it may be to be brought there straight."""

CLOSE = radians(20)
"""How far it may be from a pose between upright and a sit, all of which have the body over the soles."""

GENTLE = radians(35)
"""rad/s that joints take on the way there at most."""

SHORTEST = 0.5
"""Seconds that it takes at least."""

LEVELS = 0.003
"""Metres from one pose between upright and a sit to the next."""

SITS = 0.7
"""The share of the height of a stand at which it sits, where the robot file says nothing of that."""


@dataclass(frozen=True, slots=True)
class Approach:
    """Through poses ``rows`` (K, 12) that are reached at shares ``at`` (K,) of it, between two times in seconds."""

    rows: Floats
    at_shares: Floats
    since: float
    until: float

    @classmethod
    def begun(cls, rows: Floats, now: float) -> "Approach":
        """Return the way through these poses from time ``now`` on."""
        far = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(rows, axis=0)).max(axis=1))))
        shares = far / far[-1] if far[-1] > 0 else np.linspace(0.0, 1.0, len(rows))
        return cls(rows, shares, now, now + max(SHORTEST, 1.5 * float(far[-1]) / GENTLE))

    def share(self, now: float) -> float:
        """Return how much of its time is over, 0..1."""
        return min(1.0, (now - self.since) / (self.until - self.since))

    def at(self, now: float) -> Floats:
        """Return where the joints are to be (12,)."""
        share = self.share(now)
        share *= share * (3 - 2 * share)
        return np.array([np.interp(share, self.at_shares, column) for column in self.rows.T])


class Levels:
    """Poses of the legs between upright and a sit, the centre of mass over the middle of both soles in each of them.

    ``stand`` and ``sit`` are their places among ``rows`` (K, 12). Raises BadRequest for a sit that is out of reach.
    """

    def __init__(self, body: Body, stride: StrideKeys, limits: Mapping[str, JointLimits]) -> None:
        feet = manner_of(body, stride).feet
        lowest = SITS * stride.height if stride.sit is None else stride.sit
        above = stride.height + LEVELS * np.arange(60.0, 0.0, -1.0)
        below = np.arange(stride.height - LEVELS, lowest, -LEVELS)
        rows, reason = stands(body, stride, feet, np.concatenate((above, [stride.height], below, [lowest])))
        reached: npt.NDArray[np.bool_] = np.logical_not(reason.any(axis=1))
        for column, name in enumerate(body.walking):
            reached &= (rows[:, column] >= limits[name].lower) & (rows[:, column] <= limits[name].upper)
        if stride.sit is not None and not reached[-1]:
            told = f"base: its legs cannot bend so far that the trunk is {stride.sit:g} m above the soles"
            raise BadRequest(told, hint="give stride.sit more")
        first = last = len(above)
        while first > 0 and reached[first - 1]:
            first -= 1
        while last + 1 < len(rows) and reached[last + 1]:
            last += 1
        self.rows, self.stand, self.sit = rows[first : last + 1], len(above) - first, last - first

    def way(self, here: Floats, to: int) -> Floats | None:
        """Return the poses (K, 12) from where the legs are to one of these; None for legs that are far from all."""
        off = np.abs(self.rows - here).max(axis=1)
        near = int(off.argmin())
        if off[near] > CLOSE:
            if off[self.stand] > FAR:
                return None
            near = self.stand
        between = self.rows[near : to + 1] if near <= to else self.rows[to : near + 1][::-1]
        return np.concatenate((here[None], between))


def away_from(ready: Floats, names: Iterable[str], states: Mapping[str, Reading[JointState]]) -> dict[str, float]:
    """Return how far joints that were heard of are from where a walk begins, rad; ``ready`` is that, as ``names``."""
    goals = zip(names, ready.tolist(), strict=True)
    return {name: value.position - goal for name, goal in goals if (value := states[name].value) is not None}


def is_near(ready: Floats, names: Iterable[str], states: Mapping[str, Reading[JointState]]) -> bool:
    """Say whether joints are ``NEAR`` enough to where a walk begins."""
    return all(abs(off) <= NEAR for off in away_from(ready, names, states).values())
