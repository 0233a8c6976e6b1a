"""Stiff and limp: the torque of servos switched so that none of them jumps.

Whenever torque is switched on, the goal is first set to where the servo stands, with a finite speed: an old goal would
be taken up at once.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress

from drivers.dynamixel.bus import Bus
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.models import FULL, GOAL_POSITION, PRESENT_POSITION, TORQUE_ENABLE, TORQUE_LIMIT
from drivers.errors import BadRequest, DriverError, NoReply, NotConnected

RECENT = 0.06
"""Seconds for which a reading still says where a joint is."""


def stiffen(bus: Bus, joint: Joint) -> None:
    """Make one joint stiff where it stands, every step acknowledged. Raises NoReply, NotConnected, BadRequest."""
    goal = joint.nearest(bus.read(joint.spec.id, PRESENT_POSITION))
    bus.write_block(joint.spec.id, GOAL_POSITION.address, joint.order(goal, joint.limits.speed))
    bus.write(joint.spec.id, TORQUE_ENABLE, 1)
    joint.goal, joint.torque = joint.angle(goal), True


def stiffen_together(bus: Bus, joints: Iterable[Joint], *, now: float) -> None:
    """Make joints stiff where they are by now, in two packets that none acknowledges. Raises NotConnected."""
    places = [(joint, joint.position_at(now)) for joint in joints]
    goals = {j.name: (j, j.nearest(j.ticks(place))) for j, place in places if place is not None}
    bus.sync_write_block(
        GOAL_POSITION.address, {j.spec.id: j.order(goal, j.limits.speed) for j, goal in goals.values()}
    )
    bus.sync_write(TORQUE_ENABLE, {j.spec.id: 1 for j, _ in goals.values()})
    for joint, goal in goals.values():
        joint.goal, joint.torque = joint.angle(goal), True


def ready(bus: Bus, joints: Sequence[Joint], *, now: float) -> list[Joint]:
    """Make those joints stiff that are limp; return all that may be sent a goal. Raises NotConnected.

    Those seen a moment ago become stiff together, in two packets; any other is asked first where it stands, and left
    out if it does not say, as are servos that are not driven or have shut down.
    """
    able = [joint for joint in joints if joint.driven and not joint.shut]
    limp = [joint for joint in able if not joint.torque]
    stiffen_together(bus, [joint for joint in limp if now - joint.reading.stamp <= RECENT], now=now)
    for joint in limp:
        if not joint.torque:
            with suppress(NoReply, BadRequest):
                stiffen(bus, joint)
    return [joint for joint in able if joint.torque]


def settle(bus: Bus, joints: Iterable[Joint], *, stiff: bool, now: float) -> list[Joint]:
    """Hold or relax all joints, first together, then each until it acknowledges; return those that did not.

    Never raises. Left alone are servos that were never there, that are not what they should be, or (when holding)
    that have shut themselves down.
    """
    touched = [joint for joint in joints if joint.reading.value is not None and (joint.driven or not joint.answers)]
    if stiff:
        touched = [joint for joint in touched if not joint.shut]
    recent = [joint for joint in touched if joint.driven and now - joint.reading.stamp <= RECENT]
    together: Sequence[Joint] = ()
    with suppress(NotConnected, BadRequest):
        if stiff:
            stiffen_together(bus, recent, now=now)
            together = recent
        else:
            bus.sync_write(TORQUE_ENABLE, {joint.spec.id: 0 for joint in touched})
    names = {joint.name for joint in together}
    return [joint for joint in touched if not _settled(bus, joint, stiff=stiff, told=joint.name in names)]


def _settled(bus: Bus, joint: Joint, *, stiff: bool, told: bool) -> bool:
    """Settle one joint; try again after a miss, for the same write twice does no harm."""
    if stiff and not joint.answers:
        return False  # nobody knows where it is: stiffening it could make it jump
    for _ in range(2 if joint.answers else 1):
        try:
            if stiff and not told:
                stiffen(bus, joint)
            else:
                bus.write(joint.spec.id, TORQUE_ENABLE, int(stiff))
        except NotConnected:
            return False
        except (NoReply, BadRequest):
            continue
        joint.torque = stiff
        if not stiff:
            joint.goal = None
        return True
    return False


def recover(bus: Bus, joints: Iterable[Joint]) -> list[Joint]:
    """Give joints that have shut down their torque back, where they stand; return those that took it.

    Raises NotConnected.
    """
    recovered = []
    bus.require()
    for joint in joints:
        if not (joint.driven and joint.shut):
            continue
        try:
            stiffen(bus, joint)  # still without force: the goal must not lie elsewhere when the force returns
            bus.write(joint.spec.id, TORQUE_LIMIT, round(joint.spec.torque_limit * FULL))
            bus.write(joint.spec.id, TORQUE_ENABLE, 1)
        except NotConnected:
            raise
        except DriverError:
            continue  # the watch tells of silent servos, and of one that shuts down again
        joint.shut, joint.wanted = False, True
        recovered.append(joint)
    return recovered
