"""``mission servo import``: the joints of an arm, as other programs describe them, as those of a robot file."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import click

from config.editing import NotEditableError, require_own, rewrite, with_value
from config.faults import Source, one_of
from config.foreign import foreign_file
from config.library import PLAYED, kinds_of, wrong_kind
from config.marked import read_source
from config.writing import flow, number, word, write_new
from drivers.servos.declared import ALIASES, JointKeys
from drivers.servos.models import MODELS
from missions.cli.commands import SharingCommand
from missions.cli.numbers import Whole
from missions.cli.root import SUCCESS
from missions.library.drivers import robot_of
from missions.plugins.setup.servo.foreign_joints import ForeignJoints, foreign_joints
from missions.plugins.setup.servo.ranges import arm_of
from missions.plugins.setup.servo.ros_joints import load_ros_joints
from missions.plugins.setup.servo.target import ARM, arm_named, arm_option

# Robot files that MissionTree itself writes, of joints that were imported: read back before they are handed out.


def robot_text(
    name: str,
    joints: Mapping[str, JointKeys],
    *,
    port: str,
    baud: int = 1_000_000,
    arm: str = "arm",
    calibration: str = "",
) -> str:
    """Return the text of a robot file with an ``arm`` of ``joints`` alone; with a ``calibration`` they are Feetech's.

    Raises InvalidFileError if it is none.
    """
    lines = [
        f"robot: {word(name)}",
        "",
        f"{arm}:",
        *([] if arm == "arm" else ["  kind: arm"]),
        f"  driver: {'feetech' if calibration else 'dynamixel'}",
        f"  port: {json.dumps(port)}",
        f"  baud: {baud}",
        *([f"  calibration: {json.dumps(calibration)}"] if calibration else []),
    ]
    lines += ["  joints:", *(f"    {word(joint)}: {_joint(config)}" for joint, config in joints.items())]
    text = "\n".join(lines) + "\n"
    robot_of(Source(name, text))
    return text


def _joint(joint: JointKeys) -> str:
    """Write a joint, in steps of its servo if that is how it came."""
    if joint.ticks is None and joint.limits is None:
        return flow({"id": str(joint.id), "model": joint.model})
    if joint.ticks is None:
        limits = f"[{number(joint.lower, 6)} rad, {number(joint.upper, 6)} rad]"
        way = {"zero": f"{number(joint.zero, 6)} rad", "limits": limits, "reverse": str(joint.reverse).lower()}
    else:
        way = {"ticks": flow({key: str(value) for key, value in asdict(joint.ticks).items()})}
    power = {"speed": f"{number(joint.speed, 6)} rad/s", "torque": f"{number(100 * joint.torque, 4)} %"}
    return flow({"id": str(joint.id), "model": joint.model}, way, power)


@click.command("import", cls=SharingCommand, epilog="Example: mission servo import joints.yaml -o my_robot.yaml")
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--model", help="What its servos are, which no file says: AX-12A, or STS3215 for a calibration.")
@click.option("--port", metavar="PATH", help="Where they are plugged in: /dev/u2d2, or /dev/ttyACM0 for a calibration.")
@click.option("--baud", type=Whole(min=1), default=1_000_000, show_default=True, metavar="RATE")
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), metavar="NEW", help="Write a new "
              "robot file; without it the text goes to stdout.")  # fmt: skip
@click.option("--into", type=click.Path(exists=True, dir_okay=False, path_type=Path), metavar="ROBOT", help="Add the "
              "joints to an arm of a robot file of yours.")  # fmt: skip
@arm_option
def import_joints(
    file: Path, model: str | None, port: str | None, baud: int, output: Path | None, into: Path | None, arm: str
) -> int:
    """Import joints from a file of ROS or LeRobot.

    It becomes the joints of a robot file: a YAML of dynamixel_controllers, ArbotiX, Interbotix or dynamixel_workbench,
    or a calibration of LeRobot's. Steps of the servo stay steps. What was changed or left out is told on stderr.
    """
    if model is not None and model not in (known := [*MODELS, *ALIASES]):
        raise click.UsageError(f"--model: '{model}' is no servo that we know; {one_of(model, known)}")
    if output is not None and into is not None:
        raise click.UsageError("-o writes a new file and --into adds to one: give one of them")
    found = _imported(file, model)
    if into is not None and found.calibration:
        raise click.UsageError(f"{file} is a calibration: write `calibration: {found.calibration}` in {into}")
    port = port or ("/dev/ttyACM0" if found.calibration else "/dev/u2d2")
    text = robot_text(file.stem, found.joints, port=port, baud=baud, arm=arm, calibration=found.calibration)
    try:
        if into is not None:
            _add(into, found, text, arm)
        elif output is not None:
            write_new(output, text)
        else:
            click.echo(text, nl=False)
    except NotEditableError as error:
        raise click.UsageError(str(error)) from error
    except FileExistsError as error:
        raise click.UsageError(f"{error}; or add to it: --into {output}") from error
    for note in found.notes:
        click.echo(note, err=True)
    if output or into:
        click.echo(f"{len(found.joints)} joints written into {output or into}", err=True)
    return SUCCESS


def _imported(file: Path, model: str | None) -> ForeignJoints:
    """Read the joints of a file. Raises click.UsageError with what it is, and InvalidFileError."""
    foreign = None if kinds_of(file) else foreign_file(file)
    if foreign is None or not foreign.form or foreign.form in PLAYED:
        other = f"{file} has no joints in a form that is known here (dynamixel_controllers, ArbotiX, Interbotix, "
        other += "dynamixel_workbench, LeRobot); `mission robot new` makes a robot file of what is plugged in"
        raise click.UsageError(wrong_kind("joints", file) or other)
    usual = {"ros": "AX-12A", "arbotix": "AX-12A", "lerobot": "STS3215"}.get(foreign.form)
    if model is None and usual is None:
        raise click.UsageError(f"{file} is {foreign.what}: say what its servos are, such as --model XM430-W350")
    servos = ALIASES.get(model or "", model or usual or "")
    if foreign.form != "ros":
        return foreign_joints(file, foreign.form, servos)
    found = load_ros_joints(file, model=servos)
    return ForeignJoints(dict(found.joints), [str(note) for note in found.notes])


def _add(path: Path, found: ForeignJoints, text: str, part: str) -> None:
    """Add joints, as ``text`` has them, to an arm of a robot file, and nothing else.

    Raises NotEditableError where that cannot be, click.UsageError where it has other arms, and not this.
    """
    require_own(path, "mission servo import JOINTS.yaml --into FILE")
    source = read_source(path)
    old = robot_of(source)
    if part != ARM:
        arm_named(old, part)
    before = arm_of(old, part)
    joints: dict[str, JointKeys] = {} if before is None else dict(before.joints)
    if there := [name for name in found.joints if name in joints]:
        raise NotEditableError(f"{path}: it has {', '.join(there)} already")
    lines = text.partition("  joints:\n")[2].splitlines()
    new = source.text
    for line in reversed(lines):  # each is put in front of the others
        name, _, value = line.strip().partition(": ")
        new = with_value(Source(source.name, new), (part, "joints", name), value)
    arm = arm_of(robot_of(Source(source.name, new)), part)
    if arm is None or dict(arm.joints) != {**found.joints, **joints}:
        raise NotEditableError(
            f"{path}: its {part} is written in a way that cannot be added to; write the joints yourself"
        )
    rewrite(path, new)
