"""What a face does in front of a robot that follows it, and what the robot follows it with."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from math import radians

STEP = radians(25)
WALK = radians(20)  # per second


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
    """

    name: str
    path: Callable[[float], float]
    latency: float = 0.1
    drops: float = 0.0
    seconds: float = 6.0
    surprise: float = 6.0
    settled: float = 2.0


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


SCENARIOS = (
    Scenario("step of 25 deg", stands),
    Scenario("walk at 20 deg/s", walks),
    Scenario("walk, turning around", turns_around, surprise=3.0),
    Scenario("walk, 20 % dropped", walks, drops=0.2),
    Scenario("step, 200 ms late", stands, latency=0.2),
    Scenario("walk, 200 ms late", walks, latency=0.2),
)
"""What is benched: all with 100 ms from a picture to what it shows, unless they say otherwise."""
