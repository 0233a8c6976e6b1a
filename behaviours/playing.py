"""Keyframes as smooth motion: joint by joint, within the joints' speeds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from drivers.api import Keyframe

PEAK = 1.875
"""How much faster than its mean a minimum-jerk motion is at its fastest (Flash and Hogan, 1985)."""


@dataclass(frozen=True, slots=True)
class Playing:
    """A laid-out motion: times in seconds, and the positions of every joint at each of them (radians)."""

    times: tuple[float, ...]
    positions: tuple[Mapping[str, float], ...]

    @property
    def duration(self) -> float:
        """Seconds from the start to the last keyframe."""
        return self.times[-1]

    def at(self, time: float) -> Mapping[str, float]:
        """Return the joints' positions at ``time``; before the start and after the end, the first and the last."""
        if time <= self.times[0]:
            return self.positions[0]
        for (begin, here), (end, there) in pairwise(zip(self.times, self.positions, strict=True)):
            if time < end:
                share = _minimum_jerk((time - begin) / (end - begin))
                return {joint: here[joint] + share * (there[joint] - here[joint]) for joint in here}
        return self.positions[-1]


def slowed(
    start: Mapping[str, float], keyframes: Sequence[Keyframe], speeds: Mapping[str, float], *, pace: float = 1.0
) -> Playing:
    """Lay out ``keyframes`` from ``start``, each segment long enough for the joints' ``speeds`` (rad/s).

    A joint that a keyframe does not name stays where the one before had it. ``pace`` divides all times.
    """
    times, positions = [0.0], [dict(start)]
    before = 0.0
    for frame in keyframes:
        goal = positions[-1] | dict(frame.positions)
        needed = max((PEAK * abs(goal[joint] - positions[-1][joint]) / speeds[joint] for joint in goal), default=0.0)
        times.append(times[-1] + max((frame.time - before) / pace, needed))
        positions.append(goal)
        before = frame.time
    return Playing(tuple(times), tuple(positions))


def _minimum_jerk(share: float) -> float:
    """Return how far along a minimum-jerk motion is after ``share`` of its time, both 0..1."""
    return share**3 * (10 - 15 * share + 6 * share**2)
