"""``mission servo calibrate``: find the limits of joints by hand, and write them to the robot file."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import degrees, radians

import click

from config.library import find_file
from config.yaml_edit import NotEditableError
from drivers.errors import BadRequest, NoReply
from drivers.servos.bus import ServoBus
from drivers.servos.feetech import FeetechKeys
from drivers.servos.joint import Joint
from missions.cli.commands import SharingCommand
from missions.cli.numbers import QuantityInUnit
from missions.cli.outputs import check_writable
from missions.cli.printable import format_columns
from missions.cli.root import FAILURE, SUCCESS
from missions.plugins.setup.servo.connections import (
    OpenBus,
    confirm_limp,
    hold_option,
    open_bus,
    require_terminal,
    show_line,
    wait_for_end,
)
from missions.plugins.setup.servo.ranges import ServoRange, check_keepable, write_ranges
from missions.plugins.setup.servo.target import ServoTarget, target_options

MIN_TRAVEL = radians(5)
"""Minimum travel in radians from which on a joint counts as moved deliberately."""


@dataclass(slots=True)
class JointTravel:
    """Range of positions (steps) in which a joint's servo has been since the calibration began.

    ``zero`` is its first position, if the joint's angle is to be 0 there; otherwise None.
    """

    joint: Joint
    lowest: int
    highest: int
    zero: int | None = None

    def sample(self, bus: ServoBus) -> None:
        """Read the position of the servo; a missing reply is ignored. Raises NotConnected."""
        try:
            ticks = bus.read(self.joint.address, self.joint.model.table["present_position"])
        except (NoReply, BadRequest):
            return
        self.lowest, self.highest = min(self.lowest, ticks), max(self.highest, ticks)

    def range_within(self, margin: float) -> ServoRange | None:
        """Return the range of the servo, shortened by ``margin`` (rad) at both ends; None if the joint hardly moved."""
        short = round(margin / self.joint.model.tick)
        if (self.highest - self.lowest) * self.joint.model.tick < MIN_TRAVEL + 2 * margin:
            return None
        return ServoRange(max(0, self.lowest + short), min(self.joint.model.last_tick, self.highest - short), self.zero)


@click.command(cls=SharingCommand, epilog="Example: mission servo calibrate elbow --robot my_robot.yaml")
@target_options
@click.argument("joints", nargs=-1, metavar="[JOINT|GROUP]...")
@click.option("--zero", is_flag=True, help="Also use the pose at the start as 0 of every joint.")
@click.option("--margin", type=QuantityInUnit("deg", 0.0, 20.0), default=2.0, show_default=True, metavar="DEG",
              help="Distance of the limits from the touched ends.")  # fmt: skip
@click.option("--seconds", type=QuantityInUnit("s", 0.1), metavar="N", help="Duration; by default until Enter.")
@hold_option
def calibrate(
    target: ServoTarget, joints: tuple[str, ...], zero: bool, margin: float, seconds: float | None, yes: bool
) -> int:
    """Find the limits of joints by hand, and write them to the robot file.

    Waits until you hold the arm and press Enter, then switches the torque of the joints off (all, if you name none).
    Turn each joint to both ends. The old robot file is kept as FILE.bak. Ctrl-C writes nothing; the torque stays off
    either way. Without a terminal, joints with torque need --yes.
    """
    if target.robot is None:
        raise click.UsageError("no robot file to write: name it with --robot FILE")
    path = find_file("robots", target.robot)
    arm = target.keys
    if isinstance(arm, FeetechKeys) and arm.calibration:
        raise click.UsageError(
            f"the limits of its joints are in {arm.calibration}, and in the servos: calibrate with the program that "
            "wrote it (lerobot-calibrate, or mission servo home), or write `limits` of a joint into the robot file"
        )
    require_terminal(seconds)
    try:
        check_keepable(path)
        check_writable(path, "--robot")
        with open_bus(target) as bench:
            travels = _watch_joints(bench, bench.select_joints(joints), zero=zero, seconds=seconds, yes=yes)
        ranges = {each.joint.name: each.range_within(radians(margin)) for each in travels}
        click.echo(_table(travels, ranges))
        measured = {name: each for name, each in ranges.items() if each is not None}
        if not measured:
            click.echo("no joint was turned: nothing is written", err=True)
            return FAILURE
        try:
            before = write_ranges(path, measured, target.arm)
        except (NotEditableError, OSError):
            click.echo("the limits in steps, which could not be written:", err=True)
            for name, each in measured.items():
                click.echo(f"  {name}: {each.lowest} to {each.highest}", err=True)
            raise
    except NotEditableError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"written to {path}; the old file is {before}")
    return SUCCESS


def _watch_joints(
    bench: OpenBus, joints: Sequence[Joint], *, zero: bool, seconds: float | None, yes: bool
) -> list[JointTravel]:
    """Switch the torque of joints off, and measure the range of each until the user ends it; return the ranges."""
    make_limp(bench, joints, yes=yes)
    travels = [_start_travel(bench, joint, zero=zero) for joint in joints]
    names = ", ".join(each.joint.name for each in travels)
    click.echo(
        f"torque is off: {names}\nturn each to both its ends by hand; Enter ends it, Ctrl-C writes nothing", err=True
    )
    with wait_for_end(bench.clock, seconds) as over:
        while not over():
            for each in travels:
                each.sample(bench.bus)
            show_line("  ".join(f"{each.joint.name} {_travel_degrees(each):.0f}" for each in travels) + " deg")
    return travels


def make_limp(bench: OpenBus, joints: Iterable[Joint], *, yes: bool) -> None:
    """Switch the torque of ``joints`` off, after identifying each servo, and once a person holds the arm.

    Nothing is switched off if one servo is not as expected. Raises DeviceFault, NoReply, NotConnected, BadRequest, and
    the exceptions of ``confirm_limp``, which waits for the person.
    """
    joints = tuple(joints)
    for joint in joints:
        bench.require_sole(joint)
    stiff = any(bench.bus.read(joint.address, joint.model.table["torque_enable"]) for joint in joints)
    confirm_limp([joint.name for joint in joints], stiff=stiff, simulated=bench.simulated, yes=yes)
    for joint in joints:
        bench.require_sole(joint)  # the user may have replugged a servo
        bench.bus.write(joint.address, joint.model.table["torque_enable"], 0)


def _start_travel(bench: OpenBus, joint: Joint, *, zero: bool) -> JointTravel:
    """Return the new travel of a joint, with its present position as the only one so far."""
    ticks = bench.bus.read(joint.address, joint.model.table["present_position"])
    return JointTravel(joint, ticks, ticks, ticks if zero else None)


def _travel_degrees(travel: JointTravel) -> float:
    """Return the angle in degrees between the two ends to which a joint was moved."""
    return degrees((travel.highest - travel.lowest) * travel.joint.model.tick)


def _table(found: Iterable[JointTravel], ranges: Mapping[str, ServoRange | None]) -> str:
    """Return a table of the ends to which each joint was moved, in degrees from its old zero.

    A joint without a range in ``ranges`` gets the remark that it hardly moved.
    """
    rows = []
    for each in found:
        ends = sorted(degrees(each.joint.angle(ticks)) for ticks in (each.lowest, each.highest))
        remark = "" if ranges[each.joint.name] is not None else "hardly moved: unchanged"
        rows.append([each.joint.name, *(f"{end:+.1f}" for end in ends), f"{_travel_degrees(each):.1f}", remark])
    return format_columns(("joint", "from deg", "to deg", "range", ""), rows, left=frozenset({"joint", ""}))
