"""``mission servo torque`` and ``move``: switch torque, and move joints."""

from collections.abc import Collection, Sequence
from functools import partial
from math import degrees, radians

import click

from behaviours.joints import MoveJoints
from config.robot import RobotConfig
from config.units import si_value
from drivers.api import JointLimits
from drivers.errors import BadRequest, DeviceFault, DriverError, NoReply, NotConnected
from drivers.servos.identification import require_unique_id
from drivers.servos.joint import Joint
from drivers.servos.joint_setup import find_mismatch, restore_settings
from drivers.servos.status_report import SHUTDOWN_HINT
from drivers.servos.units import protocol_name
from missions.cli.commands import SharingCommand
from missions.cli.root import FAILURE, SUCCESS
from missions.library.target import target_of
from missions.plugins.setup.servo.connections import (
    OpenArm,
    OpenBus,
    confirm_limp,
    hold_option,
    open_arm,
    open_bus,
    pause,
)
from missions.plugins.setup.servo.leaf_run import run_leaf
from missions.plugins.setup.servo.target import ServoTarget, target_options

RECOVERY_TIMEOUT = 3.0
"""Maximum seconds until a recovered servo reports torque: servos of protocol 2.0 restart for the recovery."""

MIN_SPEED = radians(1)
"""Lowest speed at which `mission servo move` moves a joint, in rad/s."""

BOOT_TIME = 1.0
"""Seconds until a restarted servo replies."""


@click.command(cls=SharingCommand, epilog="Example: mission servo torque off --robot turtlebot2_arm")
@target_options
@click.argument("state", type=click.Choice(["on", "off", "restart", "recover"]))
@click.argument("joints", nargs=-1, metavar="[JOINT|GROUP|ID]...")
@hold_option
def torque(target: ServoTarget, state: str, joints: tuple[str, ...], yes: bool) -> int:
    """Switch the torque of joints on or off, or recover servos.

    `restart` restarts one servo; `recover` recovers those that have shut down.

    All joints, if you name none; `on` holds them where they are, with the torque limit of the robot file. The torque
    stays so. An arm without torque falls: `off` waits until you hold it and press Enter; without a terminal it needs
    --yes. Exit code 1: a servo did not confirm it, has shut down, or is not as in the robot file.

    `restart` restarts a servo of protocol 2.0, whose torque is off then; hold the arm, as for `off`. `recover` switches
    the torque of servos on again that have shut down after an overload or heat, then brings the arm to rest as its file
    says. First remove the cause: free the joint, or let the servo cool.
    """
    if state == "restart":
        if len(joints) != 1:
            raise click.UsageError("name one servo\n  try: mission servo torque restart ID|JOINT")
        return _restart_servo(target, joints[0], yes=yes)
    if state == "recover":
        if joints:
            raise click.UsageError("recover is for all servos that have shut down: name none")
        return _recover_servos(target)
    return _switch_torque(target, joints, yes=yes, on=state == "on")


def _switch_torque(target: ServoTarget, joints: Collection[str], *, yes: bool, on: bool) -> int:
    """Switch the torque of joints on or off, of all if none is named."""
    failed = 0
    with open_bus(target) as bench:
        chosen = bench.select_joints(joints)
        if not on:
            names = [joint.name for joint in chosen]
            confirm_limp(names, stiff=any(_may_have_torque(bench, each) for each in chosen),
                         simulated=bench.simulated, yes=yes)  # fmt: skip
        for joint in chosen:
            try:
                bench.require_sole(joint)
                if on:
                    _enable_torque(bench, joint)
                else:
                    bench.bus.write(joint.address, joint.model.table["torque_enable"], 0)
            except NotConnected:
                raise
            except DriverError as error:
                failed += 1
                click.echo(f"{joint.title}: {error}" + (f"\n  try: {error.hint}" if error.hint else ""), err=True)
            else:
                click.echo(f"{joint.title}: torque {'on' if on else 'off'}")
    return FAILURE if failed else SUCCESS


def _may_have_torque(bench: OpenBus, joint: Joint) -> bool:
    """Return whether a joint has torque, or does not reply. Raises NotConnected."""
    try:
        return bool(bench.bus.read(joint.address, joint.model.table["torque_enable"]))
    except (NoReply, BadRequest):
        return True


def _enable_torque(bench: OpenBus, joint: Joint) -> None:
    """Switch torque on at the present position, with the speed and torque of the robot file.

    Raises DeviceFault if its servo is not as in the file, has shut down, or keeps its torque off; NoReply,
    NotConnected, BadRequest.
    """
    bus = bench.bus
    if complaint := find_mismatch(bus, joint):
        raise DeviceFault(complaint, hint=joint.hint or f"mission servo info {joint.spec.id}{bench.options}")
    if joint.reports_shutdown:
        raise DeviceFault("has shut down; its torque stays off", hint=SHUTDOWN_HINT)
    joint.torque_request = True
    restore_settings(bus, joint, now=bench.clock.now())
    if not bus.read(joint.address, joint.model.table["torque_enable"]):
        raise DeviceFault("its torque does not stay on", hint=f"mission servo info{bench.options}")


@click.command(
    cls=SharingCommand,
    context_settings={"ignore_unknown_options": True},
    epilog="Example: mission servo move elbow 30 deg --speed '45 deg/s'",
)  # allows negative angles
@partial(target_options, baud=False)
@click.argument("joint")
@click.argument("angle", nargs=-1, required=True)
@click.option("--speed", metavar="SPEED", help='Speed, such as "45 deg/s"; by default the limit in the robot file.')
def move(target: ServoTarget, joint: str, angle: tuple[str, ...], speed: str | None) -> int:
    """Move a joint, and wait for it.

    Then the arm comes to rest as its file says. Exit code 1: the joint does not arrive.
    """
    try:
        goal = si_value(" ".join(angle), "angle")
        pace = None if speed is None else si_value(speed, "turn rate")
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    if pace is not None and pace < MIN_SPEED:
        raise click.UsageError(f"--speed {speed}: it must be above 0, and at least {degrees(MIN_SPEED):g} deg/s")
    target.require_joints()
    config = target.config()
    reach = target_of(config).reaches[target.arm]
    if joint not in reach.joints:
        wrong = reach.unknown_names([joint])
        raise BadRequest("; ".join(wrong) or f"'{joint}' is a group: name one joint")
    return _move_joint(target, config, joint, goal, pace, reach.joints[joint])


def _move_joint(
    target: ServoTarget, config: RobotConfig, joint: str, requested: float, pace: float | None, limits: JointLimits
) -> int:
    """Move a joint within its limits (rad, rad/s), and print its position."""
    goal = min(max(requested, limits.lower), limits.upper)
    clamped = "" if goal == requested else f", its limit for {degrees(requested):+.1f} deg"
    speed = {} if pace is None else {"speed": f"{min(pace, limits.speed):.9f} rad/s"}
    code, leaf = run_leaf(target, config, MoveJoints, {"to": f"{{{joint}: {goal:.9f} rad}}", **speed})
    state = leaf.robot.arm.states()[joint].value
    if state is not None:
        click.echo(f"{joint} is at {degrees(state.position):+.1f} deg{clamped}")
    return code


def _restart_servo(target: ServoTarget, servo: str, *, yes: bool) -> int:
    """Restart a servo of protocol 2.0, which also clears an overload; its torque is off then."""
    with open_bus(target) as bench:
        at, model = bench.servo(servo)
        if at.protocol != 2:
            raise BadRequest(
                f"servo {at.id} is an {model.name}: {protocol_name(at.protocol)} has no restart",
                hint="mission servo torque recover --robot FILE, after an overload; else switch its power off and on",
            )
        require_unique_id(bench.bus, at, model.number)
        stiff = bool(bench.bus.read(at, model.table["torque_enable"]))
        confirm_limp([f"servo {at.id}"], stiff=stiff, simulated=bench.simulated, yes=yes)
        require_unique_id(bench.bus, at, model.number)  # the user may have replugged a servo
        bench.bus.reboot(at)
        pause(BOOT_TIME)
        bench.bus.ping(at)
    click.echo(f"servo {at.id} has restarted; its torque is off")
    return SUCCESS


def _recover_servos(target: ServoTarget) -> int:
    """Switch the torque of servos on again that have shut down."""
    with open_arm(target) as arm:
        names = arm.joints.recover()
        stiff = _wait_for_torque(arm, names)
        health = arm.joints.health()
    if not names:
        click.echo("no servo has shut down" if not health.detail else health.detail, err=bool(health.detail))
        return FAILURE if health.detail else SUCCESS
    if stiff:
        click.echo(f"torque is on again: {', '.join(stiff)}")
        if arm.config.at_end == "relax":
            click.echo("torque is off again, as the robot file says (at_end: relax)")
    if len(stiff) < len(names):
        click.echo(f"torque is still off: {', '.join(name for name in names if name not in stiff)}", err=True)
        return FAILURE
    return SUCCESS


def _wait_for_torque(arm: OpenArm, names: Sequence[str]) -> list[str]:
    """Return the joints that report torque before ``RECOVERY_TIMEOUT``."""
    begun = arm.clock.now()
    while True:
        fresh = {name: each for name, each in arm.joints.states().items() if each.good and each.stamp > begun}
        stiff = [name for name in names if name in fresh and (state := fresh[name].value) is not None and state.torque]
        if len(stiff) == len(names) or arm.clock.now() - begun > RECOVERY_TIMEOUT:
            return stiff
        pause()
