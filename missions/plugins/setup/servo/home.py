"""``mission servo home``: calibrate Feetech servos as LeRobot does, and write its file."""

import shlex
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees, radians
from pathlib import Path

import click

from config.library import wrong_kind_error
from drivers.errors import BadRequest, DeviceFault, DriverError, NoReply
from drivers.servos.bus import ServoBus
from drivers.servos.calibration import HALF_TURN, LAST_STEP, MotorCalibration, format_calibration, load_calibration
from drivers.servos.feetech import FeetechKeys
from drivers.servos.joint import Joint
from drivers.servos.settings import RegisterChange, apply_changes, plan_changes
from missions.cli.commands import SharingCommand
from missions.cli.numbers import QuantityInUnit
from missions.cli.outputs import check_writable, save
from missions.cli.printable import format_columns
from missions.cli.root import FAILURE, SUCCESS
from missions.plugins.setup.servo import calibration_origin
from missions.plugins.setup.servo.calibrate import MIN_TRAVEL, make_limp
from missions.plugins.setup.servo.calibration_origin import origin_file
from missions.plugins.setup.servo.connections import (
    OpenBus,
    confirm_limp,
    open_bus,
    require_terminal,
    show_line,
    wait_for_end,
)
from missions.plugins.setup.servo.ranges import free_backup_path
from missions.plugins.setup.servo.target import ServoTarget, target_options

STEPS_PER_TURN = LAST_STEP + 1


@dataclass(slots=True)
class HomedServo:
    """Measurements for the calibration of a servo, in steps; positions are relative to half a turn.

    ``before`` is the offset that the servo had. With the new ``offset``, the middle of its range reads half a turn.
    ``lowest`` and ``highest`` are the ends reached so far. ``no_stops`` means that the user says that the joint can
    turn endlessly.
    """

    joint: Joint
    before: int
    offset: int
    lowest: int = 0
    highest: int = 0
    position: int = 0  # continues beyond the wrap-around of the steps
    no_stops: bool = False

    def sample(self, bus: ServoBus) -> None:
        """Read the position of the servo; a missing reply is ignored. Raises NotConnected."""
        try:
            shown = bus.read(self.joint.address, self.joint.model.table["present_position"])
        except (NoReply, BadRequest):
            return
        place = (shown + self.before - self.offset) - HALF_TURN
        self.position += (place - self.position + STEPS_PER_TURN // 2) % STEPS_PER_TURN - STEPS_PER_TURN // 2
        self.lowest, self.highest = min(self.lowest, self.position), max(self.highest, self.position)

    @property
    def is_endless(self) -> bool:
        """Whether the joint has no stops, by the user's option or by its travel."""
        return self.no_stops or self.highest - self.lowest >= STEPS_PER_TURN

    def problem(self, margin: int) -> str:
        """Return the reason why the measured range of the servo cannot be used; empty if it can.

        ``margin`` is the distance in steps that the limits keep from the ends.
        """
        if self.is_endless:
            return ""
        if self.lowest < -HALF_TURN or self.highest > STEPS_PER_TURN - HALF_TURN:
            return (
                "turned beyond half a turn from its middle, where its steps wrap around: start nearer to its middle; "
                "turn a joint without stops once all the way round, or name it: --no-stops"
            )
        return "hardly moved" if self.highest - self.lowest < MIN_TRAVEL / self.joint.model.tick + 2 * margin else ""

    def calibration(self, margin: int, drive_mode: int) -> MotorCalibration:
        """Return the servo's entry of the calibration file, with limits ``margin`` steps short of either end."""
        if self.is_endless:  # LeRobot's format
            return MotorCalibration(self.joint.spec.id, drive_mode, self.offset, 0, LAST_STEP)
        low, high = self.lowest + HALF_TURN + margin, self.highest + HALF_TURN - margin
        return MotorCalibration(self.joint.spec.id, drive_mode, self.offset, max(0, low), min(LAST_STEP, high))


def offset_for(shown: int, before: int) -> int:
    """Return the offset (steps) to set so that the servo reads half a turn at its present position.

    ``shown`` is the position that it reads now, with the offset ``before``.
    """
    return max((shown + before - HALF_TURN + STEPS_PER_TURN // 2) % STEPS_PER_TURN - STEPS_PER_TURN // 2, -HALF_TURN)


@click.command(cls=SharingCommand, epilog="Example: mission servo home --into so101.json --robot my_so101.yaml")
@target_options
@click.argument("joints", nargs=-1, metavar="[JOINT|GROUP]...")
@click.option("--into", metavar="FILE", help="Calibration file, if the robot file names none.")
@click.option("--restore", is_flag=True, help="Write the calibration file to the servos; nothing is turned.")
@click.option("--other-servos", is_flag=True,
              help="With --restore: also write to servos that seem to differ from those "
              "that were calibrated.")  # fmt: skip
@click.option("--no-stops", "endless", multiple=True, metavar="JOINT", help="A joint without stops, "
              "such as wrist_roll: its range is the whole turn, and you need not turn it.")  # fmt: skip
@click.option("--margin", type=QuantityInUnit("deg", 0.0, 20.0), default=2.0, show_default=True, metavar="DEG",
              help="Distance of the limits from the touched ends.")  # fmt: skip
@click.option("--seconds", type=QuantityInUnit("s", 0.1), metavar="N",
              help="Use the present pose as the middle, and watch for this time; by default until Enter.")  # fmt: skip
@click.option("--yes", is_flag=True, help="Do not ask: a person holds the arm, and the EEPROM may be written.")
def home(
    target: ServoTarget, joints: tuple[str, ...], into: str | None, restore: bool, other_servos: bool,
    endless: tuple[str, ...], margin: float, seconds: float | None, yes: bool,
) -> int:  # fmt: skip
    """Calibrate Feetech servos, as lerobot-calibrate does.

    Waits until you hold the arm and press Enter, then switches the torque of the joints off (all, if you name none).
    Bring each to the middle of its range, then turn each to both ends. The ranges go to a calibration file that LeRobot
    reads too; then, after a question, offset and limits go to the servos (EEPROM). Ctrl-C writes nothing; the torque
    stays off either way. --restore refuses servos that are not those of the file.
    """
    arm = target.keys
    if not isinstance(arm, FeetechKeys):
        raise click.UsageError("the robot has no Feetech servos: mission servo calibrate  finds the limits of others")
    file = _calibration_file(into or arm.calibration)
    if not yes and not sys.stdin.isatty():
        raise click.UsageError("this writes the EEPROM: add --yes, or confirm it at a terminal")
    if restore:
        with open_bus(target) as bench:
            return _restore_calibration(bench, file, bench.select_joints(joints), yes=yes, other_servos=other_servos)
    require_terminal(seconds)
    for each in (file, origin_file(file)):
        check_writable(each, "--into")
    calibration_origin.load_settings(
        file
    )  # fail before torque goes off: an unreadable file would lose the origins of other joints
    old_calibration = dict(load_calibration(str(file))) if file.exists() else {}
    with open_bus(target) as bench:
        servos = _watch_joints(bench, bench.select_joints(joints), endless, seconds, yes=yes)
        click.echo(_travel_table(servos, radians(margin)))
        if any(each.problem(_margin_steps(each, margin)) for each in servos):
            click.echo("nothing is written", err=True)
            return FAILURE
        modes = {name: int(joint.reverse) for name, joint in arm.servos.items()}
        new = {each.joint: each.calibration(_margin_steps(each, margin), modes[each.joint.name]) for each in servos}
        plans = _plan_changes(bench, new)
        if plans and (lost := calibration_origin.describe_lost_calibration(bench.bus, plans, file)):
            click.echo(lost, err=True)
        _confirm_eeprom(plans, yes=yes)
        if not _save_calibration(bench, file, old_calibration, new):
            click.echo("the servos are unchanged; --restore --into FILE writes a saved calibration", err=True)
            return FAILURE
        _apply_changes(bench, plans, file)
    if not arm.calibration:
        click.echo(f"add to the robot file: calibration: {file.absolute()}")
    return SUCCESS


def _calibration_file(path: str) -> Path:
    """Return the calibration file at ``path``. Raises click.UsageError if it is missing or has other contents."""
    if not path:
        raise click.UsageError("no calibration file given; add --into so101.json")
    file = Path(path).expanduser()
    if wrong := wrong_kind_error("calibrations", file):
        raise click.UsageError(wrong)
    return file


def _restore_calibration(bench: OpenBus, file: Path, joints: Sequence[Joint], *, yes: bool, other_servos: bool) -> int:
    """Write a calibration file to the servos of joints, if it was made with them; return the exit code."""
    known = load_calibration(str(file))
    for joint in joints:
        if joint.name not in known:
            raise BadRequest(
                f"calibration {file} has no motor '{joint.name}'; it has {', '.join(known)}",
                hint="name the joints in the robot file as the motors are named, or name other joints here",
            )
        if (number := known[joint.name].id) != joint.spec.id:
            raise BadRequest(f"calibration {file}: motor '{joint.name}' has ID {number}, the joint {joint.spec.id}")
    for joint in joints:
        bench.require_sole(joint)
    wanted = {joint: known[joint.name] for joint in joints}
    if not other_servos:
        before, now = calibration_origin.load_settings(file), calibration_origin.read_settings(bench.bus, joints)
        calibration_origin.require_same_models(before, now)
        lost = calibration_origin.describe_lost_calibration(bench.bus, joints, file)
        _confirm_doubts(
            [*calibration_origin.find_doubts(bench.bus, wanted, before, now), *[lost] * bool(lost)], yes=yes
        )
    plans = _plan_changes(bench, wanted)
    stiff = any(bench.bus.read(joint.address, joint.model.table["torque_enable"]) for joint in plans)
    confirm_limp([joint.name for joint in plans], stiff=stiff, simulated=bench.simulated, yes=yes)
    _confirm_eeprom(plans, yes=yes)
    _apply_changes(bench, plans, file)
    return SUCCESS


def _confirm_doubts(found: Sequence[str], *, yes: bool) -> None:
    """Print the reasons why the servos may not be those of the calibration, and ask whether to restore it anyway.

    Raises DeviceFault with --yes, and click.Abort if the user declines.
    """
    if not found:
        return
    if yes:
        hint = "name their own calibration file (--into FILE), or add --other-servos if it is right"
        raise DeviceFault(f"are these the servos of the calibration? {'; '.join(found)}", hint=hint)
    click.echo("are these the servos of the calibration?\n" + "\n".join(f"  {each}" for each in found), err=True)
    click.confirm("restore it all the same?", abort=True, err=True)


def _save_calibration(
    bench: OpenBus, file: Path, kept: Mapping[str, MotorCalibration], new: Mapping[Joint, MotorCalibration]
) -> bool:
    """Save the calibration and the settings that identify its servos, before any servo is changed.

    ``kept`` are the old entries of ``file``: they are saved in a backup, and stay in the file for joints that ``new``
    lacks. Return whether all is saved.
    """
    settings = {**calibration_origin.load_settings(file), **calibration_origin.read_settings(bench.bus, new)}
    if kept:
        save(free_backup_path(file), format_calibration(kept))
    if not save(file, format_calibration({**kept, **{joint.name: each for joint, each in new.items()}})):
        return False
    click.echo(f"written to {file}")
    return save(origin_file(file), calibration_origin.settings_text(settings))


def _margin_steps(homed: HomedServo, margin: float) -> int:
    return round(radians(margin) / homed.joint.model.tick)


def _watch_joints(
    bench: OpenBus, joints: Sequence[Joint], endless: Collection[str], seconds: float | None, *, yes: bool
) -> list[HomedServo]:
    """Switch torque off, take each joint's present position as its middle, and measure its range by hand.

    The user ends the measurement. Return the measurements. ``endless`` are the joints that the user named as having no
    stops.
    """
    for name in endless:
        if bench.joint(name) not in joints:
            raise click.UsageError(f"--no-stops: {name} is not one of the calibrated joints")
    make_limp(bench, joints, yes=yes)
    names = ", ".join(joint.name for joint in joints)
    if seconds is None:
        click.echo(
            f"torque is off: {names}\nbring each to the middle of its range; Enter goes on, Ctrl-C ends it", err=True
        )
        with wait_for_end(bench.clock, None) as over:
            while not over():
                show_line(" ".join(f"{joint.name} {_present_position(bench, joint)}" for joint in joints))
    servos = list(_read_middles(bench, joints, endless))
    click.echo(
        f"torque is off: {names}\nturn each to both its ends by hand; Enter ends it, Ctrl-C writes nothing", err=True
    )
    with wait_for_end(bench.clock, seconds) as over:
        while not over():
            for each in servos:
                each.sample(bench.bus)
            show_line("  ".join(f"{each.joint.name} {_travel_degrees(each):.0f}" for each in servos) + " deg")
    return servos


def _read_middles(bench: OpenBus, joints: Iterable[Joint], endless: Collection[str]) -> Iterator[HomedServo]:
    for joint in joints:
        before = bench.bus.read(joint.address, joint.model.table["position_offset"])
        offset = offset_for(_present_position(bench, joint), before)
        yield HomedServo(joint, before, offset, no_stops=joint.name in endless)


def _present_position(bench: OpenBus, joint: Joint) -> int:
    return bench.bus.read(joint.address, joint.model.table["present_position"])


def _travel_degrees(homed: HomedServo) -> float:
    return degrees((homed.highest - homed.lowest) * homed.joint.model.tick)


def _travel_table(found: Iterable[HomedServo], margin: float) -> str:
    """Return a table of the distances to which each joint was moved from its middle."""
    rows = []
    for each in found:
        tick = each.joint.model.tick
        ends = [f"{degrees(steps * tick):+.1f}" for steps in (each.lowest, each.highest)]
        remark = "turns all the way round" if each.is_endless else each.problem(round(margin / tick))
        rows.append([each.joint.name, str(each.before), str(each.offset), *ends, remark])
    return format_columns(("joint", "offset", "new", "from deg", "to deg", ""), rows, left=frozenset({"joint", ""}))


def _plan_changes(bench: OpenBus, wanted: Mapping[Joint, MotorCalibration]) -> dict[Joint, list[RegisterChange]]:
    """Return the EEPROM changes by joint, and print them."""
    plans = {}
    for joint, each in wanted.items():
        values = {"position_offset": each.homing_offset, "min_position": each.range_min, "max_position": each.range_max}
        if changes := plan_changes(bench.bus, joint.address, joint.model.table, values):
            plans[joint] = changes
            change_text = ", ".join(f"{change.register.name} {change.before} -> {change.after}" for change in changes)
            click.echo(f"{joint.title}: {change_text}")
    if not plans:
        click.echo("the servos have these values already")
    return plans


def _confirm_eeprom(plans: Collection[Joint], *, yes: bool) -> None:
    """Ask the user before the EEPROM of servos is written; with ``yes``, do not ask."""
    if plans and not yes:
        click.confirm("write this into the EEPROM?", abort=True, err=True)


def _apply_changes(bench: OpenBus, plans: Mapping[Joint, Sequence[RegisterChange]], file: Path) -> None:
    """Write register changes to the servos' EEPROM, and print them.

    If a write fails, print the servos that were not written, and raise the error of ``apply_changes``.
    """
    left = list(plans)
    try:
        for joint, changes in plans.items():
            apply_changes(bench.bus, joint.address, joint.model.table, changes)
            left.remove(joint)
            click.echo(f"{joint.title}: written and verified")
    except DriverError:
        again = f"mission servo home --restore --into {shlex.quote(str(file))}{bench.options}"
        click.echo(f"not written: {', '.join(joint.title for joint in left)}; later: {again}", err=True)
        raise
