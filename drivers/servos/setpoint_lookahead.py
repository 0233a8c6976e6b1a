"""How far a joint is sent at a time: as far as it gets in a moment, and on again before it is there.

A servo that knows its whole goal goes on to it whatever becomes of the program that sent it. One that knows a leg of
the way comes to rest by itself where that ends, and stays stiff.
"""

from math import inf, radians

from drivers.api.joints import FOLLOWING_TOLERANCE, MAX_APPROACH_SPEED
from drivers.servos.joint import Joint

LOOKAHEAD_TIME = 0.3
"""Seconds that a leg takes at the speed that the joint is told: so long does a joint go on when nobody is heard."""

MIN_LOOKAHEAD = radians(1)
"""A leg is no shorter than this: within a step or two of their goal, servos do not bother to move."""

RENEWAL_SHARE = 2 / 3
"""The share of a leg with which the next one is sent: a servo slows down for none of them."""

LOADED_LOOKAHEAD = radians(20)
"""How far a joint is sent that a burden keeps back: the nearer the goal, the less force do servos use."""

MAX_READING_AGE = 0.25
"""Seconds for which a reading says where a joint is: one that is not heard of is sent no farther."""


def next_setpoint(joint: Joint, now: float) -> int | None:
    """Return the end (ticks) of the leg that the joint is to be sent now; None while it needs none.

    It is on its way to its goal, and the leg that it was sent last is nearly over; or it takes longer than it should.
    """
    if joint.goal is None or joint.setpoint == (end := joint.ticks(joint.goal)):
        return None
    place = joint.estimated_position(now)
    if place is None or now - joint.reading.stamp > MAX_READING_AGE:
        return None
    here, far = joint.ticks(place), lookahead_distance(joint, joint.speed)
    if joint.setpoint is not None and abs(joint.setpoint - here) > RENEWAL_SHARE * far / joint.model.tick:
        if joint.reading.stamp - joint.setpoint_sent_at <= far / _servo_speed(joint, joint.speed):
            return None  # on a busy machine the reading may be older than that
        far = max(far, LOADED_LOOKAHEAD)
    return _limited_step(joint, end, here, far)


def approach_speed(joint: Joint, goal: float, speed: float, here: float | None) -> float:
    """Return the speed (rad/s) at which a joint goes to ``goal`` (radians) that is told ``speed``.

    One that was found elsewhere than it stood, or was away for long, comes over slowly, until it is near where it is
    sent.
    """
    if joint.approaches_slowly and here is not None:
        slow = joint.goal is not None and joint.speed <= MAX_APPROACH_SPEED  # it was sent on its way before
        joint.approaches_slowly = (
            min(abs(goal - here), abs((joint.goal or 0.0) - here) if slow else inf) > FOLLOWING_TOLERANCE
        )
    return min(speed, MAX_APPROACH_SPEED) if joint.approaches_slowly else speed


def hold_position(joint: Joint, here: int) -> int:
    """Return where a joint that stands at ``here`` (ticks) is to be held: there, or on its way back to its limits."""
    return _limited_step(joint, joint.clamp_ticks(here), here, lookahead_distance(joint, joint.limits.speed))


def lookahead_distance(joint: Joint, speed: float) -> float:
    """Return how far (radians) the joint is sent at a time, at ``speed`` (rad/s)."""
    return max(MIN_LOOKAHEAD, LOOKAHEAD_TIME * _servo_speed(joint, speed))


def _servo_speed(joint: Joint, speed: float) -> float:
    """Return how fast (rad/s) the servo turns that is told ``speed``."""
    return min(joint.speed_ticks(speed) * joint.model.speed_unit, joint.model.free_speed)


def _limited_step(joint: Joint, end: int, here: int, far: float) -> int:
    """Return where the way from ``here`` to ``end`` (ticks) is over after ``far`` (radians), as the servo takes it."""
    most = int(far / joint.model.tick)
    place = here + min(max(end - here, -most), most)
    low, high = (joint.value(register) for register in joint.model.table.limit_registers)
    return min(max(place, low), high) if low < high else place
