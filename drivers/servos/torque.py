"""Switching the torque of servos without a sudden motion, and sending setpoints to moving joints.

Before the torque is switched on, the goal is set to the current position, with a finite speed: otherwise the servo
would turn to an old goal at once. Moving joints get short setpoints: see ``setpoint_lookahead``.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress

from drivers.api import Quality, Reading
from drivers.clock import Clock
from drivers.errors import BadRequest, DriverError, NoReply, NotConnected
from drivers.servos.bus import ServoBus
from drivers.servos.joint import Joint
from drivers.servos.poll_rate import is_in_motion
from drivers.servos.setpoint_lookahead import approach_speed, hold_position, next_setpoint
from drivers.servos.units import Protocol

MAX_MOVING_READING_AGE = 0.06
"""Maximum age in seconds of a usable position of a joint that may move."""

MAX_RESTING_READING_AGE = 0.15
"""Maximum age in seconds of a usable position of a joint at rest with torque, which is read ten times a second."""

RELEASE_TIMEOUT, MAX_RELEASE_ATTEMPTS = 1.0, 10
"""Seconds and attempts for joints to confirm that they are at rest."""

REBOOT_TIME = 0.5
"""Seconds that a servo of protocol 2.0 needs to reboot."""


def write_together(bus: ServoBus, writes: Iterable[tuple[Joint, tuple[int, bytes]]]) -> None:
    """Write bytes to the servos of several joints: each of ``writes`` has a joint, an address and the bytes.

    One packet per protocol and address is sent, without acknowledgement. Raises NotConnected.
    """
    bus.require_open()
    packets: dict[tuple[Protocol, int], list[tuple[Joint, bytes]]] = {}
    for joint, (address, data) in writes:
        packets.setdefault((joint.address.protocol, address), []).append((joint, data))
    for (protocol, address), blocks in packets.items():
        bus.sync_write_block(protocol, address, {joint.spec.id: data for joint, data in blocks})


def has_recent_reading(joint: Joint, now: float) -> bool:
    """True if the newest reading of a joint is recent enough to be used as its position."""
    return now - joint.reading.stamp <= (
        MAX_RESTING_READING_AGE if joint.torque and not is_in_motion(joint) else MAX_MOVING_READING_AGE
    )


def switch_torque(bus: ServoBus, joints: Iterable[Joint], *, on: bool) -> None:
    """Switch the torque of many servos, without acknowledgement. Raises NotConnected."""
    orders = []
    for joint in joints:
        enable = joint.model.table["torque_enable"]
        orders.append((joint, (enable.address, enable.encode(int(on)))))
    write_together(bus, orders)


def stiffen(bus: ServoBus, joint: Joint, *, now: float) -> None:
    """Switch the torque of a joint on at its position, acknowledged. Raises NoReply, NotConnected, BadRequest."""
    here = bus.read(joint.address, joint.model.table["present_position"])
    _stiffen_at(bus, joint, hold_position(joint, here), now=now)


def _stiffen_at(bus: ServoBus, joint: Joint, position: int, *, now: float) -> None:
    """Set the goal of a joint to ``position`` (ticks), confirmed, then switch its torque on. Raises as ``stiffen``."""
    _write_confirmed(bus, joint, *joint.goal_write(position, joint.limits.speed))
    set_torque(bus, joint, on=True)
    _note_held_position(joint, position, now=now)


def set_torque(bus: ServoBus, joint: Joint, *, on: bool) -> None:
    """Switch the torque of a joint, with confirmation. Raises NoReply, NotConnected, BadRequest."""
    register = joint.model.table["torque_enable"]
    _write_confirmed(bus, joint, register.address, register.encode(int(on)))


def _write_confirmed(bus: ServoBus, joint: Joint, address: int, data: bytes) -> None:
    """Write ``data`` and confirm it by the reply, or by reading it back: a reply may be late on a busy machine.

    Raises NoReply, NotConnected, BadRequest.
    """
    joint.lacks_confirmation = True
    try:
        bus.write_block(joint.address, address, data)
    except NoReply:
        told = bus.read_block(joint.address, address, len(data))
        joint.lacks_confirmation = False
        if told != data:
            raise


def _note_held_position(joint: Joint, position: int, *, now: float) -> None:
    """Record that a joint holds ``position`` (ticks)."""
    joint.goal, joint.speed, joint.torque = joint.angle(joint.clamp_ticks(position)), joint.limits.speed, True
    joint.setpoint, joint.setpoint_sent_at = position, now


def stop_together(bus: ServoBus, joints: Iterable[Joint], *, now: float) -> dict[Joint, int]:
    """Set the goals of joints to their estimated positions, in one unacknowledged packet; return the goals (ticks).

    Joints without any reading are left out. Raises NotConnected.
    """
    angles = [(joint, joint.estimated_position(now)) for joint in joints]
    places = {joint: hold_position(joint, joint.ticks(angle)) for joint, angle in angles if angle is not None}
    write_together(bus, [(joint, joint.goal_write(place, joint.limits.speed)) for joint, place in places.items()])
    return places


def stiffen_together(bus: ServoBus, joints: Iterable[Joint], *, now: float) -> None:
    """Switch the torque of joints on at their estimated positions, in two unacknowledged packets. Raises NotConnected.

    For joints that get a new goal at once: if the first packet is lost, they start towards an old goal.
    """
    places = stop_together(bus, joints, now=now)
    switch_torque(bus, places, on=True)
    for joint, place in places.items():
        _note_held_position(joint, place, now=now)


def start_motion(
    bus: ServoBus, joints: Sequence[Joint], goals: Mapping[str, float], speeds: Mapping[str, float], now: float
) -> None:
    """Start joints towards ``goals`` (rad, within the limits) at ``speeds`` (rad/s; default: their limits).

    Switches their torque on first. Joints that cannot move are marked as excluded. Raises NotConnected.
    """
    going = make_ready(bus, joints, now=now)
    for joint in joints:
        joint.excluded_from_move = joint not in going
        if joint.excluded_from_move:
            joint.progress.hold(None)
    for joint in going:
        goal = goals[joint.name]
        speed = approach_speed(joint, goal, speeds.get(joint.name, joint.limits.speed), joint.estimated_position(now))
        if (goal, speed) != (joint.goal, joint.speed):
            joint.goal, joint.speed, joint.setpoint = goal, speed, None
        joint.torque_request, joint.is_unconfirmed = True, False
        joint.progress.command(goal, speed, now)
    send_setpoints(bus, going, now=now)


def send_setpoints(bus: ServoBus, joints: Iterable[Joint], *, now: float) -> None:
    """Send the next setpoints of moving joints that need one, in one unacknowledged packet. Raises NotConnected."""
    able = [joint for joint in joints if joint.torque and joint.is_driven and not joint.is_shut_down]
    legs = {joint: place for joint in able if (place := next_setpoint(joint, now)) is not None}
    if legs:
        write_together(bus, [(joint, joint.goal_write(place, joint.speed)) for joint, place in legs.items()])
    for joint, place in legs.items():
        joint.setpoint, joint.setpoint_sent_at = place, now


def make_ready(bus: ServoBus, joints: Sequence[Joint], *, now: float) -> list[Joint]:
    """Switch the torque of joints on where it is off; return all joints that have torque. Raises NotConnected.

    Joints with a recent reading, and joints that answer a read, are switched on together in two packets. Each of the
    others is tried once more, alone. Joints that do not answer then are left out, and so are joints that are not driven
    or have shut down.
    """
    able = [joint for joint in joints if joint.is_driven and not joint.is_shut_down]
    limp = [joint for joint in able if not joint.torque]
    stiffen_together(
        bus, [joint for joint in limp if has_recent_reading(joint, now) or _read_once(bus, joint, now)], now=now
    )
    for joint in limp:
        if not joint.torque:
            with suppress(NoReply, BadRequest):
                stiffen(bus, joint, now=now)
    return [joint for joint in able if joint.torque]


def _read_once(bus: ServoBus, joint: Joint, now: float) -> bool:
    """Read a joint, once; return True if it answered. Raises NotConnected."""
    fast = joint.model.table.fast_block
    try:
        joint.store(fast, bus.read_block(joint.address, fast.address, fast.size, tries=1))
    except (NoReply, BadRequest):
        return False
    joint.reading = Reading(joint.state(), now, Quality.GOOD)
    return True


def hold_or_relax(bus: ServoBus, joints: Iterable[Joint], *, stiff: bool, now: float) -> list[Joint]:
    """Hold or relax joints, first together, then each until it acknowledges; return those that did not.

    Never raises. Skips servos that this driver never gave torque, and, when holding, those that have shut down. A servo
    that is not driven any more can be relaxed, but not held.
    """
    joints = tuple(joints)
    ours = [joint for joint in joints if joint.may_have_torque and not (stiff and joint.is_shut_down)]
    places: Mapping[Joint, int] = {}
    with suppress(NotConnected, BadRequest):
        if stiff:
            recent = [joint for joint in ours if joint.is_driven and has_recent_reading(joint, now)]
            places = stop_together(bus, recent, now=now)
        else:
            switch_torque(bus, ours, on=False)
    for joint in joints:
        before = joint.is_unconfirmed
        joint.is_unconfirmed = joint in ours and not _hold_or_relax_one(
            bus, joint, places.get(joint), stiff=stiff, now=now
        )
        if joint.is_unconfirmed and not before:
            joint.unconfirmed_since = now
        joint.lacks_confirmation = joint.lacks_confirmation and bus.is_open
    return [joint for joint in ours if joint.is_unconfirmed]


def _hold_or_relax_one(bus: ServoBus, joint: Joint, position: int | None, *, stiff: bool, now: float) -> bool:
    """Hold or relax one joint; return True if it confirmed that. A joint that was answering is tried twice.

    In the first try the joint is held at ``position`` (ticks). If that is None, and in the second try, it is held at
    its current position.
    """
    joint.lacks_confirmation = not joint.is_answering
    if stiff and not joint.is_driven:
        return False  # its position and goal are unknown: torque could make it jump
    for _ in range(2 if joint.is_answering else 1):
        try:
            joint.lacks_confirmation = True
            if not stiff:
                set_torque(bus, joint, on=False)
            elif position is None:
                stiffen(bus, joint, now=now)
            else:
                _stiffen_at(bus, joint, position, now=now)
        except NotConnected:
            return False
        except (NoReply, BadRequest) as error:
            position = None
            joint.lacks_confirmation = joint.lacks_confirmation and isinstance(error, NoReply)
            continue
        joint.torque = stiff
        if not stiff:
            joint.goal = None
        return True
    return False


def release_attempts(bus: ServoBus, failed: Collection[Joint], clock: Clock) -> Iterator[None]:
    """Yield before each new attempt to bring the ``failed`` joints to rest, while one of them may still confirm it.

    It ends after ``MAX_RELEASE_ATTEMPTS``, after ``RELEASE_TIMEOUT``, and when the bus is closed.
    """
    until = clock.now() + RELEASE_TIMEOUT
    for _ in range(MAX_RELEASE_ATTEMPTS):
        able = any(joint.is_driven or not joint.is_answering for joint in failed)
        if not (able and bus.is_open and clock.now() < until):
            return
        yield


def recover_joints(bus: ServoBus, joints: Iterable[Joint], *, now: float) -> list[Joint]:
    """Switch the torque of joints that have shut down on again, at their current positions.

    Returns the joints whose servos have accepted it. A servo of protocol 2.0 is rebooted, after which the monitor has
    to find it again. Raises NotConnected.
    """
    recovered = []
    bus.require_open()
    for joint in joints:
        if not (joint.is_driven and joint.is_shut_down):
            continue
        try:
            if joint.address.protocol != 2:
                _rearm(bus, joint, now=now)
            else:
                bus.reboot(joint.address)
                joint.undriven_reason, joint.next_read_at, joint.torque = "is rebooting", now + REBOOT_TIME, False
        except NotConnected:
            raise
        except DriverError:
            continue  # the monitor reports silent servos, and a repeated shutdown
        joint.is_shut_down, joint.torque_request = False, True
        recovered.append(joint)
    return recovered


def _rearm(bus: ServoBus, joint: Joint, *, now: float) -> None:
    """Switch the torque of a servo on again after a shutdown, if its protocol (1.0 or STS) needs no reboot for this.

    Raises NoReply, NotConnected, BadRequest.
    """
    table = joint.model.table
    if joint.address.protocol == "STS":
        set_torque(bus, joint, on=False)  # else it stays in its overload
    stiffen(bus, joint, now=now)  # still without torque: the goal must be its position when the torque returns
    bus.write(joint.address, table[table.torque_limit], joint.torque_ticks)
    bus.write(joint.address, table["torque_enable"], 1)
