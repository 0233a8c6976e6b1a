"""``mission servo mirror``: make an arm follow another one, which the user moves by hand; each arm has its own port."""

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
"""Maximum seconds to wait for a position reading of the leading arm."""

DISPLAY_INTERVAL = 0.1
"""Seconds between two status lines."""


@click.command(cls=SharingCommand, epilog="Example: mission servo mirror so101_leader --robot so101")
@target_options
@click.argument("leader")
@click.option("--leader-arm", default=DEFAULT_ARM, metavar="NAME", help="Name of the leader's arm, if it has several.")
@click.option("--leader-port", metavar="PATH", help="Port of the leader, instead of the one in its file.")
@click.option("--by-range", "ranged", multiple=True, default=["gripper"], show_default=True, metavar="JOINT",
              help="Joint that follows its leader by percentage of the range, instead of by angle.")  # fmt: skip
@click.option("--seconds", type=QuantityInUnit("s", 0.1), metavar="N", help="Duration; by default until Enter.")
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
    """Make an arm follow another that you move by hand.

    LEADER is a robot (a name or a file) with joints of the same names, on another port; it may be the same robot if
    that has two arms. Hold the leader and press Enter; then its torque goes off. The arm of --robot moves slowly to the
    pose of the leader, then follows at once. At the end the torque of the leader stays off, and the follower comes to
    rest as its file says. Without a terminal a leader with torque needs --yes.
    """
    require_terminal(seconds)
    target.require_joints()
    first = replace(target, robot=leader, arm=leader_arm, port=leader_port, baud=None, simulate=target.is_virtual)
    first.check()
    couplings = couple_joints(
        _limits_of(first), _limits_of(target), ranged
    )  # rejects a wrong leader before anything is opened
    with open_arms(first, target) as (leading, following):
        leading.wait_for_reports({each.leader for each in couplings})
        following.wait_for_reports({each.follower for each in couplings})
        leading.confirm_limp(leading.joints.limits, yes=yes)
        leading.joints.relax()
        click.echo(f"the torque of {leader} is off: move it by hand; Enter ends it", err=True)
        _mirror(leading, following, couplings, seconds)
    return SUCCESS


def _limits_of(target: ServoTarget) -> Mapping[str, JointLimits]:
    return target.keys.limits


def couple_joints(
    leader: Mapping[str, JointLimits], follower: Mapping[str, JointLimits], ranged: Sequence[str]
) -> list[Coupling]:
    """Return how each joint of the follower is to follow the joint of the leader with the same name.

    The range of a joint in ``ranged`` is mapped from the leader's limits to those of the follower. Raises
    click.UsageError if the arms have no joint name in common, or if a leader's joint has equal limits.
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
        raise click.UsageError(f"no joints with the same name: {has}")
    return found


def _mirror(leading: OpenArm, following: OpenArm, couplings: Sequence[Coupling], seconds: float | None) -> None:
    """Send goals to the follower after each reading of the leader, until the user ends it or ``seconds`` are over."""
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
            except NotConnected:  # its driver reports it and reconnects
                mirroring.pause()
                continue
            if clock.now() - shown > DISPLAY_INTERVAL:
                shown = clock.now()
                show_line("  ".join(f"{joint} {degrees(goal):+.0f}" for joint, goal in goals.items()) + " deg")
