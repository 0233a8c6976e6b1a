"""``mission servo home``: the calibration of Feetech servos as users of LeRobot know it, and its file."""

import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import degrees, radians
from pathlib import Path

import click

from drivers.dynamixel.bus import Bus
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.settings import apply, planned
from drivers.errors import BadRequest, NoReply
from drivers.feetech.calibration import HALF_TURN, LAST, MotorCalibration, load, text
from drivers.feetech.declared import FeetechKeys
from missions.cli.numbers import Real
from missions.cli.root import FAILURE, SUCCESS
from missions.cli.servo.bench import Bench, opened_bus
from missions.cli.servo.calibrate import LEAST, limp
from missions.cli.servo.change import yes_option
from missions.cli.servo.ranges import free
from missions.cli.servo.target import Target, target_options
from missions.cli.servo.until import patience, require_terminal, show
from missions.views.columns import in_columns

TURN = LAST + 1


@dataclass(slots=True)
class Homed:
    """A servo as it is turned, in steps from the half turn at which it is to show its middle; ``offset`` does that."""

    joint: Joint
    before: int
    offset: int
    lowest: int = 0
    highest: int = 0
    last: int = 0
    torn: bool = False  # it has come to where its steps begin anew

    def look(self, bus: Bus) -> None:
        """Look where the servo is now; one look that gets no answer is no harm. Raises NotConnected."""
        try:
            shown = bus.read(self.joint.at, self.joint.model.table["present_position"])
        except (NoReply, BadRequest):
            return
        place = (shown + self.before - self.offset) % TURN - HALF_TURN
        self.torn = self.torn or abs(place - self.last) > TURN // 2
        self.last = place
        self.lowest, self.highest = min(self.lowest, place), max(self.highest, place)

    def trouble(self, margin: int) -> str:
        """Say why its range is none; empty when it is one."""
        if self.torn:
            return "turned through half a turn from its middle, where its steps begin anew"
        return "hardly turned" if self.highest - self.lowest < LEAST / self.joint.model.tick + 2 * margin else ""

    def found(self, margin: int, drive_mode: int) -> MotorCalibration:
        """Return what the calibration file is to say, ``margin`` steps short of either end."""
        low, high = self.lowest + HALF_TURN + margin, self.highest + HALF_TURN - margin
        return MotorCalibration(self.joint.spec.id, drive_mode, self.offset, max(0, low), min(LAST, high))


def offset_for(shown: int, before: int) -> int:
    """Return the offset with which a servo shows the half turn that now shows ``shown``, with an offset ``before``."""
    return max((shown + before - HALF_TURN + TURN // 2) % TURN - TURN // 2, -HALF_TURN)


@click.command(epilog="Example: mission servo home --into so101.json --robot my_so101.yaml")
@target_options
@click.argument("joints", nargs=-1, metavar="[JOINT|GROUP]...")
@click.option("--into", metavar="FILE", help="The calibration file, where the robot file names none.")
@click.option("--restore", is_flag=True, help="Set the servos to what the calibration file says; nothing is turned.")
@click.option("--margin", type=Real(0.0, 20.0), default=2.0, show_default=True, metavar="DEG",
              help="How far before the ends that are touched the limits lie.")  # fmt: skip
@click.option("--seconds", type=Real(min=0.1), metavar="N",
              help="Take where the arm stands for its middle, and watch for so long; else until Enter.")  # fmt: skip
@yes_option
def home(
    target: Target, joints: tuple[str, ...], into: str | None, restore: bool, margin: float, seconds: float | None,
    yes: bool,
) -> int:  # fmt: skip
    """Calibrate Feetech servos, as lerobot-calibrate does.

    Makes the joints limp (all, if none is named): hold the arm. Bring each to the middle of its range, then turn each
    to both its ends. The position offset and the limits go into the servos (EEPROM), after a question, and with the
    ranges into a calibration file that LeRobot reads too. Ctrl-C writes nothing; the joints stay limp either way.
    """
    arm = target.keys
    if not isinstance(arm, FeetechKeys):
        raise click.UsageError("the robot has no Feetech servos: mission servo calibrate  finds the limits of others")
    path = into or arm.calibration
    if not path:
        raise click.UsageError("where is the calibration to be kept? --into so101.json")
    if not yes and not sys.stdin.isatty():
        raise click.UsageError("this writes the EEPROM: add --yes, or confirm it at a terminal")
    if restore:
        with opened_bus(target) as bench:
            return _written(bench, {joint: load(path)[joint.name] for joint in bench.chosen(joints)}, yes=yes)
    require_terminal(seconds)
    file = Path(path).expanduser()
    kept = dict(load(path)) if file.exists() else {}
    with opened_bus(target) as bench:
        chosen = bench.chosen(joints)
        found = _turned(bench, chosen, seconds)
        click.echo(_table(found, radians(margin)))
        if any(each.trouble(_steps(each, margin)) for each in found):
            click.echo("nothing is written", err=True)
            return FAILURE
        modes = {name: int(joint.reverse) for name, joint in arm.servos.items()}
        new = {each.joint: each.found(_steps(each, margin), modes[each.joint.name]) for each in found}
        _written(bench, new, yes=yes)
    if kept:
        free(file).write_bytes(file.read_bytes())
    file.write_text(text(kept | {joint.name: each for joint, each in new.items()}), encoding="utf-8")
    click.echo(
        f"written into {path}"
        + ("" if arm.calibration else f"; the robot file is to say calibration: {file.absolute()}")
    )
    return SUCCESS


def _steps(homed: Homed, margin: float) -> int:
    return round(radians(margin) / homed.joint.model.tick)


def _turned(bench: Bench, joints: Iterable[Joint], seconds: float | None) -> list[Homed]:
    """Make the joints limp, take their middle, and watch how far they are turned."""
    joints = list(joints)
    for joint in joints:
        limp(bench, joint)
    names = ", ".join(joint.name for joint in joints)
    if seconds is None:
        click.echo(f"limp: {names}\nbring each to the middle of its range; Enter goes on, Ctrl-C ends it", err=True)
        with patience(bench.clock, None) as over:
            while not over():
                show(" ".join(f"{joint.name} {_shown(bench, joint)}" for joint in joints))
    found = list(_middles(bench, joints))
    click.echo(f"limp: {names}\nturn each to both its ends by hand; Enter ends it, Ctrl-C writes nothing", err=True)
    with patience(bench.clock, seconds) as over:
        while not over():
            for each in found:
                each.look(bench.bus)
            show("  ".join(f"{each.joint.name} {_width(each):.0f}" for each in found) + " deg")
    return found


def _middles(bench: Bench, joints: Iterable[Joint]) -> Iterator[Homed]:
    for joint in joints:
        before = bench.bus.read(joint.at, joint.model.table["position_offset"])
        yield Homed(joint, before, offset_for(_shown(bench, joint), before))


def _shown(bench: Bench, joint: Joint) -> int:
    return bench.bus.read(joint.at, joint.model.table["present_position"])


def _width(homed: Homed) -> float:
    return degrees((homed.highest - homed.lowest) * homed.joint.model.tick)


def _table(found: Iterable[Homed], margin: float) -> str:
    """Return how far each was turned from its middle."""
    rows = []
    for each in found:
        tick = each.joint.model.tick
        ends = [f"{degrees(steps * tick):+.1f}" for steps in (each.lowest, each.highest)]
        rows.append([each.joint.name, str(each.before), str(each.offset), *ends, each.trouble(round(margin / tick))])
    return in_columns(("joint", "offset", "new", "from deg", "to deg", ""), rows, left=frozenset({"joint", ""}))


def _written(bench: Bench, wanted: Mapping[Joint, MotorCalibration], *, yes: bool) -> int:
    """Say what is to be changed in the EEPROM, ask, change it, and say so."""
    plans = {}
    for joint, each in wanted.items():
        values = {"position_offset": each.homing_offset, "min_position": each.range_min, "max_position": each.range_max}
        if changes := planned(bench.bus, joint.at, joint.model.table, values):
            plans[joint] = changes
            said = ", ".join(f"{change.register.name} {change.before} -> {change.after}" for change in changes)
            click.echo(f"{joint.title}: {said}")
    if plans and not yes:
        click.confirm("write this into the EEPROM?", abort=True, err=True)
    for joint, changes in plans.items():
        apply(bench.bus, joint.at, joint.model.table, changes)
        click.echo(f"{joint.title}: written and verified")
    if not plans:
        click.echo("the servos are set so already")
    return SUCCESS
