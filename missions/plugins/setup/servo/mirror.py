"""``mission servo mirror``: an arm that copies another, which somebody moves by hand; each has a port of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import degrees
from threading import Event

import click

from behaviours.joint_motion import JointMirror, has_range, range_coupling
from drivers.api import Coupling, JointLimits
from drivers.errors import NotConnected
from drivers.servos.driver import DynamixelJoints
from missions.cli.commands import SharingCommand
from missions.cli.numbers import QuantityInUnit
from missions.cli.root import SUCCESS
from missions.plugins.setup.servo.connections import (
    OpenArm,
    hold_option,
    open_arms,
    require_terminal,
    show_line,
    wait_for_end,
)
from missions.plugins.setup.servo.target import DEFAULT_ARM, ServoTarget, target_options

LEADER_TIMEOUT = 0.05
"""Seconds that a reading of the leader is waited for, at most."""

DISPLAY_INTERVAL = 0.1
"""Seconds between two lines of where the follower is sent."""


@click.command(cls=SharingCommand, epilog="Example: mission servo mirror so101_leader --robot so101")
@target_options
@click.argument("leader")
@click.option(
    "--leader-arm", default=DEFAULT_ARM, metavar="NAME", help="Which arm of the leader, where it has several."
)
@click.option("--leader-port", metavar="PATH", help="Where the leader is plugged in, instead of what its file says.")
@click.option("--by-range", "ranged", multiple=True, default=["gripper"], show_default=True, metavar="JOINT",
              help="A joint that goes as far through its range as its leader, not to the same angle.")  # fmt: skip
@click.option("--seconds", type=QuantityInUnit("s", 0.1), metavar="N", help="Mirror for so long; else until Enter.")
@hold_option
def mirror(
    target: ServoTarget,
    leader: str,
    leader_arm: str,
    leader_port: str | None,
    ranged: tuple[str, ...],
    seconds: float | None,
    yes: bool,
) -> int:
    """Let an arm copy another that is moved by hand.

    LEADER is a robot (a name or a file) with joints of the same names, on another port; it may be the same robot, where
    that has two arms. It waits until you hold the leader and press Enter; then that goes limp. The arm of --robot comes
    over slowly to where the leader stands, then follows at once. In the end the leader stays limp, and the follower
    comes to the rest that its file asks for. Without a terminal a stiff leader goes limp with --yes alone.
    """
    require_terminal(seconds)
    target.require_joints()
    first = replace(target, robot=leader, arm=leader_arm, port=leader_port, baud=None, simulate=target.is_virtual)
    first.check()
    couplings = couple_joints(
        _limits_of(first), _limits_of(target), ranged
    )  # a wrong leader is told before anything is opened
    with open_arms(first, target) as (leading, following):
        leading.wait_for_reports({each.leader for each in couplings})
        following.wait_for_reports({each.follower for each in couplings})
        leading.confirm_limp(leading.joints.limits, yes=yes)
        leading.joints.relax()
        click.echo(f"{leader} is limp, and leads: move it by hand; Enter ends it", err=True)
        _mirror(leading, following, couplings, seconds)
    return SUCCESS


def _limits_of(target: ServoTarget) -> Mapping[str, JointLimits]:
    return target.keys.limits


def couple_joints(
    leader: Mapping[str, JointLimits], follower: Mapping[str, JointLimits], ranged: Sequence[str]
) -> list[Coupling]:
    """Return who leads whom: joints of one name. Raises click.UsageError where there are none.

    Nor may one lead by a range that has none.
    """
    fixed = [joint for joint in ranged if joint in leader and joint in follower and not has_range(leader[joint])]
    if fixed:
        raise click.UsageError(f"{', '.join(fixed)}: the leader's limits are equal: no range to go through")
    found = [
        range_coupling(joint, leader[joint], joint, limits) if joint in ranged else Coupling(joint, joint)
        for joint, limits in follower.items()
        if joint in leader
    ]
    if not found:
        has = f"the leader has {', '.join(leader)}, the follower {', '.join(follower)}"
        raise click.UsageError(f"no joint of the one has the name of one of the other: {has}")
    return found


def _mirror(leading: OpenArm, following: OpenArm, couplings: Sequence[Coupling], seconds: float | None) -> None:
    """Send the follower on after each reading of the leader, until it is over."""
    read, arms = Event(), (leading.joints, following.joints)
    mirroring = JointMirror(*arms, couplings)
    if isinstance(leading.joints, DynamixelJoints):
        leading.joints.poll_fast({each.leader for each in couplings}, read.set)
    clock, shown = following.clock, 0.0
    with wait_for_end(clock, seconds, lambda: read.wait(LEADER_TIMEOUT)) as over:
        while not over():
            read.clear()
            try:
                goals = mirroring.step(clock.now())
            except NotConnected:  # its driver has told so, and looks for it
                mirroring.pause()
                continue
            if clock.now() - shown > DISPLAY_INTERVAL:
                shown = clock.now()
                show_line("  ".join(f"{joint} {degrees(goal):+.0f}" for joint, goal in goals.items()) + " deg")
