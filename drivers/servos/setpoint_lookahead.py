"""Setpoint lookahead: a joint is not sent its goal, but setpoints a short way ahead of its position.

The next setpoint is sent before the joint reaches the last one. A servo that was sent its final goal would move on to
it if the controlling program died. With a short lookahead it comes to rest by itself at the last setpoint, and keeps
its torque.
"""

from math import inf, radians

from drivers.api.joints import FOLLOWING_TOLERANCE, MAX_APPROACH_SPEED
from drivers.servos.joint import Joint

LOOKAHEAD_TIME = 0.3
"""Seconds that a joint needs to reach its setpoint at the commanded speed; without a newer setpoint it stops there."""

MIN_LOOKAHEAD = radians(1)
"""Shortest lookahead in radians: servos ignore goals within a step or two."""

RENEWAL_SHARE = 2 / 3
"""Share of the lookahead that is still to go when the next setpoint is sent, so that the servo does not slow down."""

LOADED_LOOKAHEAD = radians(20)
"""Lookahead (radians) of a joint that a load holds back: servos use less force near their goal."""

MAX_READING_AGE = 0.25
"""Maximum age in seconds of a reading for a new setpoint; a silent joint gets none."""


def next_setpoint(joint: Joint, now: float) -> int | None:
    """Return the next setpoint (ticks) of a moving joint; None if none is due.

    It is due if the joint is near its last setpoint, or takes longer than expected.
    """
    if joint.goal is None or joint.setpoint == (end := joint.ticks(joint.goal)):
        return None
    place = joint.estimated_position(now)
    if place is None or now - joint.reading.stamp > MAX_READING_AGE:
        return None
    here, far = joint.ticks(place), lookahead_distance(joint, joint.speed)
    if joint.setpoint is not None and abs(joint.setpoint - here) > RENEWAL_SHARE * far / joint.model.tick:
        if joint.reading.stamp - joint.setpoint_sent_at <= far / _servo_speed(joint, joint.speed):
            return None  # on a busy machine the reading may be older
        far = max(far, LOADED_LOOKAHEAD)
    return _limited_step(joint, end, here, far)


def approach_speed(joint: Joint, goal: float, speed: float, here: float | None) -> float:
    """Return the speed (rad/s) at which a joint moves to ``goal`` (radians), at most ``speed``.

    A joint that was displaced, or was offline for long, moves slowly until it is near its goal.
    """
    if joint.approaches_slowly and here is not None:
        slow = joint.goal is not None and joint.speed <= MAX_APPROACH_SPEED  # it already has a setpoint
        joint.approaches_slowly = (
            min(abs(goal - here), abs((joint.goal or 0.0) - here) if slow else inf) > FOLLOWING_TOLERANCE
        )
    return min(speed, MAX_APPROACH_SPEED) if joint.approaches_slowly else speed


def hold_position(joint: Joint, here: int) -> int:
    """Return the position (ticks) at which to hold a joint that is at ``here`` (ticks).

    That is ``here`` itself or, beyond the joint's limits, a position at most one lookahead distance back towards them.
    """
    return _limited_step(joint, joint.clamp_ticks(here), here, lookahead_distance(joint, joint.limits.speed))


def lookahead_distance(joint: Joint, speed: float) -> float:
    """Return the lookahead (radians) at ``speed`` (rad/s)."""
    return max(MIN_LOOKAHEAD, LOOKAHEAD_TIME * _servo_speed(joint, speed))


def _servo_speed(joint: Joint, speed: float) -> float:
    """Return the speed (rad/s) that the servo reaches at a commanded ``speed``."""
    return min(joint.speed_ticks(speed) * joint.model.speed_unit, joint.model.free_speed)


def _limited_step(joint: Joint, end: int, here: int, far: float) -> int:
    """Return the position at most ``far`` (radians) from ``here`` towards ``end`` (ticks), within the limits."""
    most = int(far / joint.model.tick)
    place = here + min(max(end - here, -most), most)
    low, high = (joint.value(register) for register in joint.model.table.limit_registers)
    return min(max(place, low), high) if low < high else place
