"""How far a joint is sent at a time: as far as it gets in a moment, and on again before it is there.

A servo that knows its whole goal goes on to it whatever becomes of the program that sent it. One that knows a leg of
the way comes to rest by itself where that ends, and stays stiff.
"""

from math import inf, radians

from drivers.api.joints import FOLLOWING_TOLERANCE, RUN_IN
from drivers.servos.joint import Joint

AHEAD = 0.3
"""Seconds that a leg takes at the speed that the joint is told: so long does a joint go on when nobody is heard."""

SHORTEST = radians(1)
"""A leg is no shorter than this: within a step or two of their goal, servos do not bother to move."""

LEFT = 2 / 3
"""The share of a leg with which the next one is sent: a servo slows down for none of them."""

LABOURED = radians(20)
"""How far a joint is sent that a burden keeps back: the nearer the goal, the less force do servos use."""

KNOWN = 0.25
"""Seconds for which a reading says where a joint is: one that is not heard of is sent no farther."""


def leg(joint: Joint, now: float) -> int | None:
    """Return the end (ticks) of the leg that the joint is to be sent now; None while it needs none.

    It is on its way to its goal, and the leg that it was sent last is nearly over; or it takes longer than it should.
    """
    if joint.goal is None or joint.sent == (end := joint.ticks(joint.goal)):
        return None
    place = joint.position_at(now)
    if place is None or now - joint.reading.stamp > KNOWN:
        return None
    here, far = joint.ticks(place), reach(joint, joint.speed)
    if joint.sent is not None and abs(joint.sent - here) > LEFT * far / joint.model.tick:
        if joint.reading.stamp - joint.sent_at <= far / _pace(joint, joint.speed):
            return None  # on a busy machine the reading may be older than that
        far = max(far, LABOURED)
    return _towards(joint, end, here, far)


def paced(joint: Joint, goal: float, speed: float, here: float | None) -> float:
    """Return the speed (rad/s) at which a joint goes to ``goal`` (radians) that is told ``speed``.

    One that was found elsewhere than it stood, or was away for long, comes over slowly, until it is near where it is
    sent.
    """
    if joint.strayed and here is not None:
        slow = joint.goal is not None and joint.speed <= RUN_IN  # it was sent on its way before
        joint.strayed = min(abs(goal - here), abs((joint.goal or 0.0) - here) if slow else inf) > FOLLOWING_TOLERANCE
    return min(speed, RUN_IN) if joint.strayed else speed


def nearest(joint: Joint, here: int) -> int:
    """Return where a joint that stands at ``here`` (ticks) is to be held: there, or on its way back to its limits."""
    return _towards(joint, joint.nearest(here), here, reach(joint, joint.limits.speed))


def reach(joint: Joint, speed: float) -> float:
    """Return how far (radians) the joint is sent at a time, at ``speed`` (rad/s)."""
    return max(SHORTEST, AHEAD * _pace(joint, speed))


def _pace(joint: Joint, speed: float) -> float:
    """Return how fast (rad/s) the servo turns that is told ``speed``."""
    return min(joint.speed_ticks(speed) * joint.model.speed_unit, joint.model.free_speed)


def _towards(joint: Joint, end: int, here: int, far: float) -> int:
    """Return where the way from ``here`` to ``end`` (ticks) is over after ``far`` (radians), as the servo takes it."""
    most = int(far / joint.model.tick)
    place = here + min(max(end - here, -most), most)
    low, high = (joint.value(register) for register in joint.model.table.limits)
    return min(max(place, low), high) if low < high else place
