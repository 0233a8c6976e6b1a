"""Stiff and limp: the torque of servos switched so that none of them jumps, and joints sent on their way.

Whenever torque is switched on, the goal is first set to where the servo stands, with a finite speed: an old goal would
be taken up at once. On its way a joint is sent a short leg at a time: see ``legs``.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress

from drivers.api import Quality, Reading
from drivers.clock import Clock
from drivers.errors import BadRequest, DriverError, NoReply, NotConnected
from drivers.servos.attention import under_way
from drivers.servos.bus import Bus
from drivers.servos.joint import Joint
from drivers.servos.legs import leg, nearest, paced
from drivers.servos.units import Protocol

RECENT = 0.06
"""Seconds for which a reading still says where a joint is that may move."""

STOOD = 0.15
"""The same for one that is stiff and at rest: nobody turns it, and it is read ten times a second."""

RELEASE_TIMEOUT, TRIES = 1.0, 10
"""Seconds for which, and how often, joints are told to rest that have not confirmed that they do."""

REBOOT = 0.5
"""Seconds that a servo of protocol 2.0 is given to start again."""


def send(bus: Bus, orders: Iterable[tuple[Joint, tuple[int, bytes]]]) -> None:
    """Write each servo some bytes from an address on: in one packet for all, or one for each kind of control table.

    None acknowledges it. Raises NotConnected.
    """
    bus.require()
    packets: dict[tuple[Protocol, int], list[tuple[Joint, bytes]]] = {}
    for joint, (address, data) in orders:
        packets.setdefault((joint.at.protocol, address), []).append((joint, data))
    for (protocol, address), blocks in packets.items():
        bus.sync_write_block(protocol, address, {joint.spec.id: data for joint, data in blocks})


def seen_lately(joint: Joint, now: float) -> bool:
    """Whether the newest reading of a joint says where it is."""
    return now - joint.reading.stamp <= (STOOD if joint.torque and not under_way(joint) else RECENT)


def switch(bus: Bus, joints: Iterable[Joint], *, on: bool) -> None:
    """Switch the torque of many servos, which none acknowledges. Raises NotConnected."""
    orders = []
    for joint in joints:
        enable = joint.model.table["torque_enable"]
        orders.append((joint, (enable.address, enable.encode(int(on)))))
    send(bus, orders)


def stiffen(bus: Bus, joint: Joint, *, now: float) -> None:
    """Make one joint stiff where it stands, every step acknowledged. Raises NoReply, NotConnected, BadRequest."""
    here = bus.read(joint.at, joint.model.table["present_position"])
    _stiffen_at(bus, joint, nearest(joint, here), now=now)


def _stiffen_at(bus: Bus, joint: Joint, place: int, *, now: float) -> None:
    """Make one joint stiff at ``place`` (ticks), which it has confirmed before its torque comes on. Raises as above."""
    _confirmed(bus, joint, *joint.order(place, joint.limits.speed))
    enable(bus, joint, on=True)
    _held(joint, place, now=now)


def enable(bus: Bus, joint: Joint, *, on: bool) -> None:
    """Switch the torque of one joint, which it has confirmed then. Raises NoReply, NotConnected, BadRequest."""
    register = joint.model.table["torque_enable"]
    _confirmed(bus, joint, register.address, register.encode(int(on)))


def _confirmed(bus: Bus, joint: Joint, address: int, data: bytes) -> None:
    """Write ``data``, and see it there: a reply that is late on a busy machine says no more than that. Raises so."""
    joint.mute = True
    try:
        bus.write_block(joint.at, address, data)
    except NoReply:
        told = bus.read_block(joint.at, address, len(data))
        joint.mute = False
        if told != data:
            raise


def _held(joint: Joint, place: int, *, now: float) -> None:
    """Take note that a joint was made stiff at ``place`` (ticks)."""
    joint.goal, joint.speed, joint.torque = joint.angle(joint.nearest(place)), joint.limits.speed, True
    joint.sent, joint.sent_at = place, now


def stop_together(bus: Bus, joints: Iterable[Joint], *, now: float) -> dict[Joint, int]:
    """Tell joints to go where they are by now, in one packet that none acknowledges; return these places (ticks).

    Raises NotConnected.
    """
    angles = [(joint, joint.position_at(now)) for joint in joints]
    places = {joint: nearest(joint, joint.ticks(angle)) for joint, angle in angles if angle is not None}
    send(bus, [(joint, joint.order(place, joint.limits.speed)) for joint, place in places.items()])
    return places


def stiffen_together(bus: Bus, joints: Iterable[Joint], *, now: float) -> None:
    """Make joints stiff where they are by now, in two packets that none acknowledges. Raises NotConnected.

    For joints that are sent elsewhere in the next moment: should the first packet be lost, they go to an old goal.
    """
    places = stop_together(bus, joints, now=now)
    switch(bus, places, on=True)
    for joint, place in places.items():
        _held(joint, place, now=now)


def go(bus: Bus, joints: Sequence[Joint], goals: Mapping[str, float], speeds: Mapping[str, float], now: float) -> None:
    """Let joints set out for goals (rad, within the limits) at their speeds (rad/s) or, without one, at their limit's.

    Limp ones become stiff first. Those that cannot go are marked as left out. Raises NotConnected.
    """
    going = ready(bus, joints, now=now)
    for joint in joints:
        joint.left_out = joint not in going
        if joint.left_out:
            joint.progress.hold(None)
    for joint in going:
        goal = goals[joint.name]
        speed = paced(joint, goal, speeds.get(joint.name, joint.limits.speed), joint.position_at(now))
        if (goal, speed) != (joint.goal, joint.speed):
            joint.goal, joint.speed, joint.sent = goal, speed, None
        joint.wanted, joint.unsettled = True, False
        joint.progress.command(goal, speed, now)
    go_on(bus, going, now=now)


def go_on(bus: Bus, joints: Iterable[Joint], *, now: float) -> None:
    """Send joints that need it farther on their way, in one packet that none acknowledges. Raises NotConnected."""
    able = [joint for joint in joints if joint.torque and joint.driven and not joint.shut]
    legs = {joint: place for joint in able if (place := leg(joint, now)) is not None}
    if legs:
        send(bus, [(joint, joint.order(place, joint.speed)) for joint, place in legs.items()])
    for joint, place in legs.items():
        joint.sent, joint.sent_at = place, now


def ready(bus: Bus, joints: Sequence[Joint], *, now: float) -> list[Joint]:
    """Make those joints stiff that are limp; return all that may be sent a goal. Raises NotConnected.

    Those become stiff together, in two packets, that were seen a moment ago, or say where they stand when they are
    asked; any other is asked once more, and left out if it does not say, as are servos that are not driven or have shut
    down.
    """
    able = [joint for joint in joints if joint.driven and not joint.shut]
    limp = [joint for joint in able if not joint.torque]
    stiffen_together(bus, [joint for joint in limp if seen_lately(joint, now) or _seen(bus, joint, now)], now=now)
    for joint in limp:
        if not joint.torque:
            with suppress(NoReply, BadRequest):
                stiffen(bus, joint, now=now)
    return [joint for joint in able if joint.torque]


def _seen(bus: Bus, joint: Joint, now: float) -> bool:
    """Read a joint, once; say whether it has answered. Raises NotConnected."""
    fast = joint.model.table.fast
    try:
        joint.take(fast, bus.read_block(joint.at, fast.address, fast.size, tries=1))
    except (NoReply, BadRequest):
        return False
    joint.reading = Reading(joint.state(), now, Quality.GOOD)
    return True


def settle(bus: Bus, joints: Iterable[Joint], *, stiff: bool, now: float) -> list[Joint]:
    """Hold or relax joints, first together, then each until it acknowledges; return those that did not.

    Never raises. Left alone are servos that this driver never touched or (when holding) that have shut themselves
    down. What is not what it should be any more is relaxed like the others, but cannot be held.
    """
    joints = tuple(joints)
    ours = [joint for joint in joints if joint.touched and not (stiff and joint.shut)]
    places: Mapping[Joint, int] = {}
    with suppress(NotConnected, BadRequest):
        if stiff:
            recent = [joint for joint in ours if joint.driven and seen_lately(joint, now)]
            places = stop_together(bus, recent, now=now)
        else:
            switch(bus, ours, on=False)
    for joint in joints:
        before = joint.unsettled
        joint.unsettled = joint in ours and not _settled(bus, joint, places.get(joint), stiff=stiff, now=now)
        if joint.unsettled and not before:
            joint.unsettled_at = now
        joint.mute = joint.mute and bus.is_open
    return [joint for joint in ours if joint.unsettled]


def _settled(bus: Bus, joint: Joint, place: int | None, *, stiff: bool, now: float) -> bool:
    """Settle one joint, at ``place`` (ticks) or where it says that it stands; try again after a miss."""
    joint.mute = not joint.answers
    if stiff and not joint.driven:
        return False  # nobody knows where it is, or where it would go: stiffening it could make it jump
    for _ in range(2 if joint.answers else 1):
        try:
            joint.mute = True
            if not stiff:
                enable(bus, joint, on=False)
            elif place is None:
                stiffen(bus, joint, now=now)
            else:
                _stiffen_at(bus, joint, place, now=now)
        except NotConnected:
            return False
        except (NoReply, BadRequest) as error:
            place = None
            joint.mute = joint.mute and isinstance(error, NoReply)
            continue
        joint.torque = stiff
        if not stiff:
            joint.goal = None
        return True
    return False


def insisting(bus: Bus, failed: Collection[Joint], clock: Clock) -> Iterator[None]:
    """Count out the tries in which those that have ``failed`` to confirm their rest yet may, as long as some can."""
    until = clock.now() + RELEASE_TIMEOUT
    for _ in range(TRIES):
        able = any(joint.driven or not joint.answers for joint in failed)
        if not (able and bus.is_open and clock.now() < until):
            return
        yield


def recover(bus: Bus, joints: Iterable[Joint], *, now: float) -> list[Joint]:
    """Give joints that have shut down their torque back, where they stand; return those that take it.

    A servo of protocol 2.0 has to start anew for it: whoever looks for servos that are not driven finds it again.
    Raises NotConnected.
    """
    recovered = []
    bus.require()
    for joint in joints:
        if not (joint.driven and joint.shut):
            continue
        try:
            if joint.at.protocol != 2:
                _rearm(bus, joint, now=now)
            else:
                bus.reboot(joint.at)
                joint.complaint, joint.due, joint.torque = "is starting again", now + REBOOT, False
        except NotConnected:
            raise
        except DriverError:
            continue  # the watch tells of silent servos, and of one that shuts down again
        joint.shut, joint.wanted = False, True
        recovered.append(joint)
    return recovered


def _rearm(bus: Bus, joint: Joint, *, now: float) -> None:
    """Give a servo that needs no restart its force back. Raises NoReply, NotConnected, BadRequest."""
    table = joint.model.table
    if joint.at.protocol == "STS":
        enable(bus, joint, on=False)  # else it stays in its overload
    stiffen(bus, joint, now=now)  # still without force: the goal must not lie elsewhere when the force returns
    bus.write(joint.at, table[table.torque_limit], joint.torque_ticks)
    bus.write(joint.at, table["torque_enable"], 1)
