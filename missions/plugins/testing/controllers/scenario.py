"""What a face does in front of a robot that follows it, and what the robot follows it with."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from math import pi, radians, sin
from random import Random

StampNoise = Callable[[float, Random], float]
"""Returns by how many seconds a stamp is off at a time of the scenario; random values come from its second argument."""

STEP = radians(25)
WALK = radians(20)  # per second
RUN = radians(60)
SWING = radians(10)

ASIDE, STAYS, STILL = radians(12), 0.75, 1.0
"""While a robot learns, a face is this far to a side (radians), for so many seconds each; in the end it stands."""

LEARNING = STILL + 4 * STAYS
"""Seconds that a robot has to learn its delays: three with something to learn from."""


class Body(StrEnum):
    """What turns: the head on a base that stands, the base with the camera on it, or both."""

    HEAD = "head"
    BASE = "base"
    BOTH = "both"


@dataclass(frozen=True, slots=True)
class Scenario:
    """A face that is there from time 0 on, at the bearing ``path(time)`` (radians, left of where the robot looks then).

    What it does can be foreseen up to ``surprise`` seconds: whether the robot has centred it counts up to then. The
    camera takes 20 pictures a second; a share ``drops`` of them gets lost, the others are known ``latency`` seconds
    later. ``settled`` is the time from which on the error counts as that of a robot that follows.

    What the robot is not told: its camera stamps pictures ``stamped`` seconds after their exposure, their latency
    varies by ``jitter`` seconds to both sides, its base begins what it is told ``base_lag`` seconds later. Before time
    0 it has ``learning`` seconds, of which the face jumps to and fro in all but the last. ``other`` is the path of a
    second face. ``stamp_noise`` is added to each stamp, ``delay_change`` (seconds) to those from time 0 on.
    """

    name: str
    path: Callable[[float], float]
    latency: float = 0.1
    drops: float = 0.0
    seconds: float = 6.0
    surprise: float = 6.0
    settled: float = 2.0
    stamped: float = 0.0
    jitter: float = 0.0
    base_lag: float = 0.0
    learning: float = 0.0
    other: Callable[[float], float] | None = None
    stamp_noise: StampNoise | None = None
    delay_change: float = 0.0

    def delay(self, time: float) -> float:
        """Return how many seconds after their exposure pictures of ``time`` are stamped, apart from the noise."""
        return self.stamped + (self.delay_change if time >= 0.0 else 0.0)

    def bearing(self, time: float) -> float:
        """Return the bearing of the face at ``time``, also while the robot learns."""
        if time >= 0.0:
            return self.path(time)
        since = time + self.learning
        if since < 0.0 or time > -STILL:
            return 0.0
        return ASIDE if since % (2 * STAYS) < STAYS else -ASIDE


def stands(time: float) -> float:
    """Return the bearing of a face that appears aside, and stays there."""
    del time
    return STEP


def walks(time: float) -> float:
    """Return the bearing of a face that walks by at an even angular speed."""
    return WALK * time


def turns_around(time: float) -> float:
    """Return the bearing of a face that walks by, and back again after 3 seconds."""
    return WALK * (time if time < 3.0 else 6.0 - time)


def runs(time: float) -> float:
    """Return the bearing of a face that goes by three times as fast, and stops when it is well aside."""
    return RUN * min(time, 1.5)


def comes_across(time: float) -> float:
    """Return the bearing of a face that crosses the way of one that walks by, a second after time 0."""
    return WALK * (2.0 - time)


def swings(period: float) -> Callable[[float], float]:
    """Return the path of a face that sways by 10 degrees to both sides, once in ``period`` seconds."""

    def path(time: float) -> float:
        return SWING * sin(2 * pi * time / period)

    return path


def uniform(most: float) -> StampNoise:
    """Return the noise of stamps that jitter by up to ``most`` seconds to both sides."""

    def noise(time: float, random: Random) -> float:
        del time
        return random.uniform(-most, most)

    return noise


SCENARIOS = (
    Scenario("step of 25 deg", stands),
    Scenario("walk at 20 deg/s", walks),
    Scenario("walk, turning around", turns_around, surprise=3.0),
    Scenario("walk, 20 % dropped", walks, drops=0.2),
    Scenario("step, 200 ms late", stands, latency=0.2),
    Scenario("walk, 200 ms late", walks, latency=0.2),
)
"""What is benched: all with 100 ms from a picture to what it shows, unless they say otherwise."""

DELAYS = (
    *(
        Scenario(
            f"stamps {1000 * late:+.0f} ms", stands, latency=max(0.1, late + 0.01), stamped=late, learning=LEARNING
        )
        for late in (-0.05, 0.0, 0.02, 0.05, 0.15)
    ),
    *(Scenario(f"base {1000 * lag:.0f} ms", stands, base_lag=lag, learning=LEARNING) for lag in (0.1, 0.2, 0.3)),
    *(
        Scenario(f"{name}, {1000 * late:.0f} ms late", path, latency=late, learning=LEARNING)
        for name, path in (("step", stands), ("walk", walks))
        for late in (0.0, 0.2, 0.3)
    ),
    *(
        Scenario(f"{name}, jitter 80 ms", path, jitter=0.08, learning=LEARNING)
        for name, path in (("step", stands), ("walk", walks))
    ),
    *(Scenario(f"walk, {100 * lost:.0f} % dropped", walks, drops=lost, learning=LEARNING) for lost in (0.2, 0.5)),
    Scenario("run at 60 deg/s", runs, learning=LEARNING, surprise=1.5, settled=0.7, seconds=4.0),
    *(
        Scenario(f"swing in {period:g} s", swings(period), learning=LEARNING, seconds=9.0, settled=3.0, surprise=0.0)
        for period in (0.25, 0.5, 1.0, 2.0)
    ),
    Scenario("two cross", walks, other=comes_across, learning=LEARNING),
)
"""What is benched by `--delays`: what no robot is told, and what no prediction can know."""

JITTERS = (0.01, 0.02, 0.03)
"""Seconds by which stamps jitter to both sides in `--stamps`."""

STAMPS = (
    *(
        Scenario(f"{name} ±{1000 * most:.0f} ms{after}", path, stamp_noise=uniform(most), learning=learning)
        for after, learning in (("", LEARNING), (", at once", 0.0))
        for name, path in (("step", stands), ("walk", walks))
        for most in JITTERS
    ),
    *(
        Scenario(f"delay {1000 * change:+.0f} ms", stands, delay_change=change, learning=LEARNING)
        for change in (0.08, -0.08)
    ),
)
"""What is benched by `--stamps`: stamps that jitter, with seconds to learn and "at once", and a delay that changes."""
