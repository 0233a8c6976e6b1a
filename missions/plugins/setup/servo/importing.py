"""``mission servo import``: the joints of an arm, as other programs describe them, as those of a robot file."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from types import MappingProxyType

import click

from config.declared import nearest, note_mistakes, read_keys
from config.editing import NotEditableError, require_own, rewrite, with_value
from config.faults import Diagnostic, InvalidFileError, Source, one_of
from config.fields import Fields, fields_of, value_of
from config.foreign import foreign_file
from config.library import PLAYED, kinds_of, wrong_kind
from config.marked import Mapping as MarkedMapping
from config.marked import Node, read_source
from config.units import seen
from config.writing import flow, number, word, write_new
from drivers.api.keys import Mistake, declared, key, keys
from drivers.servos.declared import ALIASES, JointKeys, Ticks, last_id
from drivers.servos.models import MODELS, Model
from missions.cli.commands import SharingCommand
from missions.cli.numbers import Whole
from missions.cli.root import SUCCESS
from missions.library.drivers import robot_of
from missions.plugins.setup.servo.foreign_joints import PAIRED, ForeignJoints, foreign_joints
from missions.plugins.setup.servo.ranges import arm_of
from missions.plugins.setup.servo.target import ARM, arm_named, arm_option

# The joints of a robot as the ROS stack ``dynamixel_controllers`` describes them, read as joints of ours.
#
# Its YAML has one controller a joint, with the servo's steps at the joint's 0 (``init``) and at its ends::
#
# elbow_controller: controller: {package: dynamixel_controllers, module: joint_position_controller, type:
# JointPositionController} joint_name: elbow joint_speed: 1.0 # rad/s, 1 where it is not given; joint_max_speed is the
# most that it may be joint_torque_limit: 0.8 # of the servo's torque motor: {id: 4, init: 512, min: 819, max: 205} #
# min above max: mounted the other way round
#
# What it does not say is the model of the servo: that is for the caller to know.

UNLIKE = {
    "JointTorqueController": "turns a wheel, and takes no positions",
    "JointTorqueControllerDualMotor": "turns wheels, and takes no positions",
}
"""The types of controller that are no joints of ours, and why."""

LEADERS = ("JointTrajectoryActionController", "TrajectoryActionController")
"""The types of controller that lead other controllers: they are left out."""


@keys
class KindKeys:
    """What runs the joint in ROS."""

    package: str = key(default="")
    module: str = key(default="")
    type: str = key(default="JointPositionController")
    others: Mapping[str, object] = key(default=MappingProxyType({}), rest=True)


@keys
class MotorKeys:
    """The servo of a joint, with its steps at the joint's 0 and at its ends."""

    id: int = key(low=0)
    init: int = key(low=0)
    min: int = key()
    max: int = key()
    acceleration: object = key(default=None)
    others: Mapping[str, object] = key(default=MappingProxyType({}), rest=True)


@keys
class ControllerKeys:
    """One joint."""

    controller: KindKeys | None = key(default=None)
    joint_name: str = key()
    motor: MotorKeys = key()
    joint_speed: float = key(default=1.0, low=0.02)
    joint_max_speed: float = key(default=inf, low=0.02)
    joint_torque_limit: float = key(default=1.0, low=0.01, high=1.0)
    joint_compliance_slope: object = key(default=None)
    joint_compliance_margin: object = key(default=None)
    joint_compliance_punch: object = key(default=None)
    others: Mapping[str, object] = key(default=MappingProxyType({}), rest=True)


KEYS = {
    part: {each.word for each in declared(of)}
    for part, of in (("", ControllerKeys), ("motor", MotorKeys), ("controller", KindKeys))
}
"""The keys of a controller that are read, and those of its parts."""

LEFT_OUT: Mapping[tuple[str, ...], str] = {
    ("joint_compliance_slope",): "compliance",
    ("joint_compliance_margin",): "compliance",
    ("joint_compliance_punch",): "compliance",
    ("motor", "acceleration"): "acceleration",
}
"""What has no place in a robot file, and what of a servo it is that stays as it is."""


@dataclass(frozen=True, slots=True)
class RosJoints:
    """The joints by name; and what was changed or left out, each at its place in the file."""

    joints: Mapping[str, JointKeys]
    notes: tuple[Diagnostic, ...]


def load_ros_joints(path: Path, *, model: str = "AX-12A") -> RosJoints:
    """Read the controllers of a file; all its servos are of ``model``. Raises InvalidFileError with every mistake."""
    return ros_joints_of(read_source(path), model=model)


def ros_joints_of(source: Source, *, model: str = "AX-12A") -> RosJoints:
    """Read the text of such a file. Raises as ``load_ros_joints`` does, and KeyError for an unknown model."""
    fields = fields_of(source, what="a file of controllers")
    reader = _Reader(MODELS[model])
    for name, node in fields.entries():
        reader.take(name.text, Fields(source, node, fields.faults, what=f"controller '{name.text}'"))
    if not reader.joints and not fields.faults:
        fields.fault(fields.node.mark, "there is no controller of a joint in it")
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return RosJoints(reader.joints, tuple(reader.notes))


class _Reader:
    """Gathers the joints of one file, and what is to be said of them."""

    def __init__(self, model: Model) -> None:
        self.joints: dict[str, JointKeys] = {}
        self.notes: list[Diagnostic] = []
        self._model = model
        self._first: dict[str, str] = {}

    def take(self, controller: str, fields: Fields) -> None:
        """Read one controller."""
        if _unlike(fields) or self._leads(fields):
            return
        mistakes = len(fields.faults)
        read = read_keys(fields, ControllerKeys)
        note_mistakes(fields, self._mistakes(read))
        if len(fields.faults) > mistakes:
            return
        note_mistakes(fields, self._twice(controller, read))
        self.joints[read.joint_name] = JointKeys(
            id=read.motor.id,
            written_model=self._model.name,
            speed=min(read.joint_speed, read.joint_max_speed),
            torque=read.joint_torque_limit,
            ticks=self._ticks(fields, read.motor),
        )
        for at in _unknown(fields):  # which ROS ignores
            self._note(fields, at, f"'{at[-1]}' is left out: dynamixel_controllers has no such key")
        for at, what in LEFT_OUT.items():
            if getattr(read.motor if at[0] == "motor" else read, at[-1]) is not None:
                self._note(fields, at, f"'{at[-1]}' is left out: the {what} of a servo stays as it is")

    def _leads(self, fields: Fields) -> bool:
        """Note a controller that leads others, and return True for it."""
        kind, node = _kind(fields)
        if node is not None and kind in LEADERS:
            what = f"{fields.what} is left out: a {seen(kind)} leads other controllers, and is no joint"
            self.notes.append(Diagnostic(fields.source, node.mark, what))
            return True
        return False

    def _mistakes(self, read: ControllerKeys) -> Iterator[Mistake]:
        """Yield what the servo cannot do."""
        for name, most in (("id", last_id(self._model)), ("init", self._model.last)):
            if getattr(read.motor, name) > most:
                at = ("motor", name)
                yield Mistake(f"'{name}' must be at most {most}", at, about=(at,))
        low, high = self._within(read.motor.min), self._within(read.motor.max)
        if low == high:
            message = f"'min' and 'max' are both {low}: the joint could not move"
            yield Mistake(message, ("motor",), about=(("motor",),))

    def _twice(self, controller: str, read: ControllerKeys) -> Iterator[Mistake]:
        """Yield what another controller has already."""
        for at, what in ((("joint_name",), f"joint '{read.joint_name}'"), (("motor", "id"), f"servo {read.motor.id}")):
            first = self._first.setdefault(what, controller)
            if first != controller:
                yield Mistake(f"{what} belongs to controller '{first}' already", at, about=(at,))

    def _ticks(self, fields: Fields, motor: MotorKeys) -> Ticks:
        """Return the steps at the joint's 0 and at its ends, which are brought within those that the servo has."""
        for name, written in (("min", motor.min), ("max", motor.max)):
            if written != (found := self._within(written)):
                has = f"an {self._model.name} has 0..{self._model.last}"
                self._note(fields, ("motor", name), f"'{name}' is {found} and not {written}: {has}")
        ticks = Ticks(init=motor.init, min=self._within(motor.min), max=self._within(motor.max))
        if not min(ticks.min, ticks.max) <= ticks.init <= max(ticks.min, ticks.max):
            ends = f"'min' {ticks.min} and 'max' {ticks.max}"
            message = f"'init' {ticks.init} lies outside {ends}: the joint cannot go to its 0"
            self._note(fields, ("motor", "init"), message)
        return ticks

    def _within(self, step: int) -> int:
        return min(max(step, 0), self._model.last)

    def _note(self, fields: Fields, at: tuple[str, ...], message: str) -> None:
        self.notes.append(Diagnostic(fields.source, nearest(fields.node, at), message))


def _unknown(fields: Fields) -> Iterator[tuple[str, ...]]:
    """Yield where keys stand that are not read."""
    for part, known in KEYS.items():
        node = fields.node_of(part) if part else fields.node
        for name in node.keys() if isinstance(node, MarkedMapping) else ():
            if name not in known:
                yield (part, name) if part else (name,)


def _kind(fields: Fields) -> tuple[object, Node | None]:
    """Return the type of a controller, and where it stands."""
    section = fields.node_of("controller")
    node = section.get("type") if isinstance(section, MarkedMapping) else None
    return ("JointPositionController" if node is None else value_of(node)), node


def _unlike(fields: Fields) -> bool:
    """Note a controller that is no joint of ours, and return True for it."""
    kind, node = _kind(fields)
    if "motor_master" in (keys := [word.text for word, _ in fields.entries()]) or "motor_slave" in keys:
        ids = [_servo(fields.node_of(word)) for word in ("motor_master", "motor_slave")]
        joint = fields.node_of("joint_name")
        name = fields.what if joint is None else value_of(joint)
        mark = next(word.mark for word, _ in fields.entries() if word.text in ("motor_master", "motor_slave"))
        fields.fault(mark, PAIRED.format(name, *ids))
    elif node is not None and kind not in ("JointPositionController", *LEADERS):
        fields.fault(
            node.mark, f"{fields.what}: a {seen(kind)} {UNLIKE.get(str(kind), 'is unknown')}", "take it out of the file"
        )
    else:
        return False
    return True


def _servo(node: Node | None) -> object:
    """Return the ID of a motor, as it is written."""
    number = node.get("id") if isinstance(node, MarkedMapping) else None
    return "?" if number is None else value_of(number)


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
