"""``mission servo torque``, ``move``, ``reboot`` and ``recover``: joints by hand."""

from math import degrees, inf

import click

from behaviours.arm import ARRIVED
from config.units import in_dimension
from drivers.dynamixel.bus import Bus
from drivers.dynamixel.joining import difference
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.torque import stiffen
from drivers.errors import BadRequest, DeviceFault, DriverError, NotConnected
from missions.cli.root import FAILURE, SUCCESS
from missions.cli.servo.bench import Arm, opened_arm, opened_bus, pause
from missions.cli.servo.target import Target, target_options

SETTLE = 1.5
"""Seconds that a joint has to arrive, beyond those that the way takes at its speed."""

BOOT = 1.0
"""Seconds after which a servo that was restarted answers."""


@click.command()
@target_options
@click.argument("state", type=click.Choice(["on", "off"]))
@click.argument("joints", nargs=-1, metavar="[JOINT|GROUP]...")
def torque(target: Target, state: str, joints: tuple[str, ...]) -> int:
    """Make joints stiff, or limp.

    All, if none is named; stiff where they stand. They stay so afterwards. A limp arm falls: hold it. Exit code 1
    where a servo did not confirm it.
    """
    failed = 0
    with opened_bus(target) as bench:
        for joint in bench.chosen(joints):
            try:
                if state == "on":
                    _stiffen(bench.bus, joint)
                else:
                    bench.bus.write(joint.at, joint.model.table["torque_enable"], 0)
            except NotConnected:
                raise
            except DriverError as error:
                failed += 1
                click.echo(f"{joint.title}: {error}" + (f"\n  try: {error.hint}" if error.hint else ""), err=True)
            else:
                click.echo(f"{joint.title} is {'stiff' if state == 'on' else 'limp'}")
    return FAILURE if failed else SUCCESS


def _stiffen(bus: Bus, joint: Joint) -> None:
    """Make a joint stiff where it stands, if its servo is what the robot file says."""
    if complaint := difference(bus, joint):
        raise DeviceFault(complaint, hint=f"mission servo info {joint.spec.id}")
    stiffen(bus, joint)


@click.command(context_settings={"ignore_unknown_options": True})  # so that an angle may be below zero
@target_options
@click.argument("joint")
@click.argument("angle", nargs=-1, required=True)
@click.option("--speed", metavar="SPEED", help='Such as "45 deg/s"; as fast as the file allows without it.')
def move(target: Target, joint: str, angle: tuple[str, ...], speed: str | None) -> int:
    """Move a joint, and wait for it.

    Such as: move elbow 30 deg. Then the arm comes to the rest that its file asks for. Exit code 1 where the joint
    does not arrive.
    """
    try:
        goal = in_dimension(" ".join(angle), "angle")
        pace = None if speed is None else in_dimension(speed, "turn rate")
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    if pace is not None and pace <= 0:
        raise click.UsageError(f"--speed {speed}: it must be above 0")
    with opened_arm(target) as arm:
        if joint not in arm.joints.limits:
            raise BadRequest("; ".join(arm.reach.unknown([joint])) or f"'{joint}' is a group: name one joint")
        return _move(arm, joint, goal, pace)


def _move(arm: Arm, joint: str, goal: float, speed: float | None) -> int:
    limits, begun = arm.joints.limits[joint], arm.clock.now()
    start = arm.joints.states()[joint].value
    accepted = arm.joints.move({joint: goal}, speeds=None if speed is None else {joint: speed})[joint]
    way = abs(accepted - (accepted if start is None else start.position))
    needed = way / min(limits.speed, speed or inf) + SETTLE
    clamped = "" if accepted == goal else f", its limit for {degrees(goal):+.1f} deg"
    while (now := arm.clock.now()) - begun < needed:
        pause()
        reading = arm.joints.states()[joint]
        state = reading.value
        if reading.good and state is not None and reading.stamp > begun and abs(state.position - accepted) <= ARRIVED:
            if state.moving and now - begun < needed - SETTLE / 2:
                continue  # it is near, and still on its way
            click.echo(f"{joint} is at {degrees(state.position):+.1f} deg{clamped} ({now - begun:.1f} s)")
            return SUCCESS
    state = arm.joints.states()[joint].value
    here = "?" if state is None else f"{degrees(state.position):+.1f}"
    load = "" if state is None else f", load {state.load:+.0%}"
    click.echo(f"{joint} stopped at {here} deg, not at {degrees(accepted):+.1f} deg{clamped}{load}", err=True)
    return FAILURE


@click.command()
@target_options
@click.argument("servo", metavar="ID|JOINT")
def reboot(target: Target, servo: str) -> int:
    """Restart a servo of protocol 2.0.

    It is limp then. That is also the way out of an overload there.
    """
    with opened_bus(target) as bench:
        at, model = bench.servo(servo)
        if at.protocol == 1:
            raise BadRequest(
                f"servo {at.id} is an {model.name}: protocol 1.0 has no restart",
                hint="mission servo recover --robot FILE, after an overload; else switch its power off and on",
            )
        bench.bus.reboot(at)
        pause(BOOT)
        bench.bus.ping(at)
    click.echo(f"servo {at.id} has restarted, and is limp")
    return SUCCESS


@click.command()
@target_options
def recover(target: Target) -> int:
    """Revive servos that have shut down.

    After an overload or heat they are made stiff again where they stand. First remove the cause: free the joint, or
    let the servo cool.
    """
    with opened_arm(target) as arm:
        names = arm.joints.recover()
        health = arm.joints.health()
    if names:
        click.echo(f"stiff again: {', '.join(names)}")
        return SUCCESS
    click.echo("no servo has shut down" if not health.detail else health.detail, err=bool(health.detail))
    return FAILURE if health.detail else SUCCESS
