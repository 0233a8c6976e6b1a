"""``mission servo import``: joints from files of other programs, as joints of a robot file."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from types import MappingProxyType

import click

from config.diagnostics import Diagnostic, InvalidFileError, SourceText, suggest_from
from config.fields import Fields, fields_of, value_of
from config.foreign_files import recognise_file
from config.library import MOVEMENT_FORMS, kinds_of, wrong_kind_error
from config.section_reader import add_mistakes, nearest_mark, read_keys
from config.units import quoted_value
from config.yaml_edit import NotEditableError, require_own, rewrite, with_value
from config.yaml_nodes import Mapping as MarkedMapping
from config.yaml_nodes import Node, read_source
from config.yaml_writer import flow_mapping, number_text, write_new, yaml_word
from drivers.api.keys import KeyDiagnostic, declared_keys, key, keys
from drivers.servos.declared import ALIASES, JointKeys, Ticks, max_id
from drivers.servos.models import MODELS, ServoModel
from missions.cli.commands import SharingCommand
from missions.cli.numbers import WholeNumber
from missions.cli.root import SUCCESS
from missions.library.drivers import parse_robot
from missions.plugins.setup.servo.foreign_joints import PAIRED_MESSAGE, ForeignJoints, foreign_joints
from missions.plugins.setup.servo.ranges import arm_keys
from missions.plugins.setup.servo.target import DEFAULT_ARM, arm_option, find_arm

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

UNSUPPORTED_TYPES = {
    "JointTorqueController": "turns a wheel, and takes no positions",
    "JointTorqueControllerDualMotor": "turns wheels, and takes no positions",
}
"""Types of ROS controllers that cannot be imported, with the reason."""

LEADER_TYPES = ("JointTrajectoryActionController", "TrajectoryActionController")
"""Types of ROS controllers that only command other controllers; they have no servo, and are left out."""


@keys
class RosKindKeys:
    """Keys of a ROS controller that name its class."""

    package: str = key(default="")
    module: str = key(default="")
    type: str = key(default="JointPositionController")
    others: Mapping[str, object] = key(default=MappingProxyType({}), rest=True)


@keys
class RosMotorKeys:
    """Keys of the section ``motor`` of a ROS controller: ID of the servo, and its steps at the joint's 0 and ends."""

    id: int = key(low=0)
    init: int = key(low=0)
    min: int = key()
    max: int = key()
    acceleration: object = key(default=None)
    others: Mapping[str, object] = key(default=MappingProxyType({}), rest=True)


@keys
class RosControllerKeys:
    """Keys of a ROS controller of one joint."""

    controller: RosKindKeys | None = key(default=None)
    joint_name: str = key()
    motor: RosMotorKeys = key()
    joint_speed: float = key(default=1.0, low=0.02)
    joint_max_speed: float = key(default=inf, low=0.02)
    joint_torque_limit: float = key(default=1.0, low=0.01, high=1.0)
    joint_compliance_slope: object = key(default=None)
    joint_compliance_margin: object = key(default=None)
    joint_compliance_punch: object = key(default=None)
    others: Mapping[str, object] = key(default=MappingProxyType({}), rest=True)


READ_KEYS = {
    part: {each.word for each in declared_keys(of)}
    for part, of in (("", RosControllerKeys), ("motor", RosMotorKeys), ("controller", RosKindKeys))
}
"""Known keys of a ROS controller and of its sections."""

OMITTED_KEYS: Mapping[tuple[str, ...], str] = {
    ("joint_compliance_slope",): "compliance",
    ("joint_compliance_margin",): "compliance",
    ("joint_compliance_punch",): "compliance",
    ("motor", "acceleration"): "acceleration",
}
"""Keys of a ROS controller that are not imported, each with the name of the servo setting that they would change."""


@dataclass(frozen=True, slots=True)
class RosJoints:
    """Joints by name from a file of ROS controllers.

    ``notes`` say which keys were changed or left out, with their positions in the file.
    """

    joints: Mapping[str, JointKeys]
    notes: tuple[Diagnostic, ...]


def load_ros_joints(path: Path, *, model: str = "AX-12A") -> RosJoints:
    """Return the joints of a file of ROS controllers; all its servos are of ``model``.

    Raises InvalidFileError with every error.
    """
    return ros_joints_of(read_source(path), model=model)


def ros_joints_of(source: SourceText, *, model: str = "AX-12A") -> RosJoints:
    """Return the joints in the text of a file of ROS controllers.

    Raises as ``load_ros_joints`` does, and KeyError for an unknown model.
    """
    fields = fields_of(source, subject="a file of controllers")
    reader = _JointReader(MODELS[model])
    for name, node in fields.entries():
        reader.add(name.text, Fields(source, node, fields.diagnostics, subject=f"controller '{name.text}'"))
    if not reader.joints and not fields.diagnostics:
        fields.add_error(fields.node.mark, "no joint controllers found")
    if fields.diagnostics:
        raise InvalidFileError(fields.diagnostics)
    return RosJoints(reader.joints, tuple(reader.notes))


class _JointReader:
    """Collects the joints of one file of ROS controllers, and notes on changed or omitted keys."""

    def __init__(self, model: ServoModel) -> None:
        self.joints: dict[str, JointKeys] = {}
        self.notes: list[Diagnostic] = []
        self._model = model
        self._first_owners: dict[str, str] = {}

    def add(self, controller: str, fields: Fields) -> None:
        """Add the joint of one controller, or the errors in its keys."""
        if _is_unsupported(fields) or self._is_leader(fields):
            return
        mistakes = len(fields.diagnostics)
        read = read_keys(fields, RosControllerKeys)
        add_mistakes(fields, self._find_errors(read))
        if len(fields.diagnostics) > mistakes:
            return
        add_mistakes(fields, self._find_duplicates(controller, read))
        self.joints[read.joint_name] = JointKeys(
            id=read.motor.id,
            written_model=self._model.name,
            speed=min(read.joint_speed, read.joint_max_speed),
            torque=read.joint_torque_limit,
            ticks=self._clamped_ticks(fields, read.motor),
        )
        for at in _unknown_keys(fields):  # ROS ignores unknown keys
            self._note(fields, at, f"'{at[-1]}' is left out: dynamixel_controllers has no such key")
        for at, what in OMITTED_KEYS.items():
            if getattr(read.motor if at[0] == "motor" else read, at[-1]) is not None:
                self._note(fields, at, f"'{at[-1]}' is left out: the {what} of a servo stays as it is")

    def _is_leader(self, fields: Fields) -> bool:
        """Return whether a controller only commands other controllers; if so, add a note."""
        kind, node = _controller_type(fields)
        if node is not None and kind in LEADER_TYPES:
            what = f"{fields.subject} is left out: a {quoted_value(kind)} leads other controllers, and is not a joint"
            self.notes.append(Diagnostic(fields.source, node.mark, what))
            return True
        return False

    def _find_errors(self, read: RosControllerKeys) -> Iterator[KeyDiagnostic]:
        """Yield an error for each value of a controller that its servo does not support."""
        for name, most in (("id", max_id(self._model)), ("init", self._model.last_tick)):
            if getattr(read.motor, name) > most:
                at = ("motor", name)
                yield KeyDiagnostic(f"'{name}' must be at most {most}", at, about=(at,))
        low, high = self._clamp(read.motor.min), self._clamp(read.motor.max)
        if low == high:
            message = f"'min' and 'max' are both {low}: the joint could not move"
            yield KeyDiagnostic(message, ("motor",), about=(("motor",),))

    def _find_duplicates(self, controller: str, read: RosControllerKeys) -> Iterator[KeyDiagnostic]:
        """Yield an error if another controller of the file has the same joint name, or the same servo ID."""
        for at, what in ((("joint_name",), f"joint '{read.joint_name}'"), (("motor", "id"), f"servo {read.motor.id}")):
            first = self._first_owners.setdefault(what, controller)
            if first != controller:
                yield KeyDiagnostic(f"{what} belongs to controller '{first}' already", at, about=(at,))

    def _clamped_ticks(self, fields: Fields, motor: RosMotorKeys) -> Ticks:
        """Return the servo's steps at the joint's 0 and at its ends, limited to the range of the servo.

        A value that had to be limited, and a 0 outside of the ends, are noted.
        """
        for name, written in (("min", motor.min), ("max", motor.max)):
            if written != (found := self._clamp(written)):
                has = f"an {self._model.name} has 0..{self._model.last_tick}"
                self._note(fields, ("motor", name), f"'{name}' is {found} and not {written}: {has}")
        ticks = Ticks(init=motor.init, min=self._clamp(motor.min), max=self._clamp(motor.max))
        if not min(ticks.min, ticks.max) <= ticks.init <= max(ticks.min, ticks.max):
            ends = f"'min' {ticks.min} and 'max' {ticks.max}"
            message = f"'init' {ticks.init} lies outside {ends}: the joint cannot go to its 0"
            self._note(fields, ("motor", "init"), message)
        return ticks

    def _clamp(self, step: int) -> int:
        return min(max(step, 0), self._model.last_tick)

    def _note(self, fields: Fields, at: tuple[str, ...], message: str) -> None:
        self.notes.append(Diagnostic(fields.source, nearest_mark(fields.node, at), message))


def _unknown_keys(fields: Fields) -> Iterator[tuple[str, ...]]:
    """Yield the paths of the unknown keys of a ROS controller."""
    for part, known in READ_KEYS.items():
        node = fields.node_of(part) if part else fields.node
        for name in node.keys() if isinstance(node, MarkedMapping) else ():
            if name not in known:
                yield (part, name) if part else (name,)


def _controller_type(fields: Fields) -> tuple[object, Node | None]:
    """Return the type of a ROS controller, and the YAML node that holds it."""
    section = fields.node_of("controller")
    node = section.get("type") if isinstance(section, MarkedMapping) else None
    return ("JointPositionController" if node is None else value_of(node)), node


def _is_unsupported(fields: Fields) -> bool:
    """Return whether a controller is unsupported, and add the error if so."""
    kind, node = _controller_type(fields)
    if "motor_master" in (keys := [word.text for word, _ in fields.entries()]) or "motor_slave" in keys:
        ids = [_motor_id(fields.node_of(word)) for word in ("motor_master", "motor_slave")]
        joint = fields.node_of("joint_name")
        name = fields.subject if joint is None else value_of(joint)
        mark = next(word.mark for word, _ in fields.entries() if word.text in ("motor_master", "motor_slave"))
        fields.add_error(mark, PAIRED_MESSAGE.format(name, *ids))
    elif node is not None and kind not in ("JointPositionController", *LEADER_TYPES):
        fields.add_error(
            node.mark,
            f"{fields.subject}: a {quoted_value(kind)} {UNSUPPORTED_TYPES.get(str(kind), 'is unknown')}",
            "take it out of the file",
        )
    else:
        return False
    return True


def _motor_id(node: Node | None) -> object:
    """Return the ID of a motor as written."""
    number = node.get("id") if isinstance(node, MarkedMapping) else None
    return "?" if number is None else value_of(number)


# Robot files with imported joints; each is parsed again before it is returned.


def robot_text(
    name: str,
    joints: Mapping[str, JointKeys],
    *,
    port: str,
    baud: int = 1_000_000,
    arm: str = "arm",
    calibration: str = "",
) -> str:
    """Return the text of a robot file that has only an ``arm`` with ``joints``.

    With a ``calibration``, which is a file of LeRobot, the servos are Feetech's. Raises InvalidFileError if the result
    is invalid.
    """
    lines = [
        f"robot: {yaml_word(name)}",
        "",
        f"{arm}:",
        *([] if arm == "arm" else ["  kind: arm"]),
        f"  driver: {'feetech' if calibration else 'dynamixel'}",
        f"  port: {json.dumps(port)}",
        f"  baud: {baud}",
        *([f"  calibration: {json.dumps(calibration)}"] if calibration else []),
    ]
    lines += ["  joints:", *(f"    {yaml_word(joint)}: {_joint_text(config)}" for joint, config in joints.items())]
    text = "\n".join(lines) + "\n"
    parse_robot(SourceText(name, text))
    return text


def _joint_text(joint: JointKeys) -> str:
    """Return a joint as YAML; its limits are in servo steps if the imported file had steps."""
    if joint.ticks is None and joint.limits is None:
        return flow_mapping({"id": str(joint.id), "model": joint.model})
    if joint.ticks is None:
        limits = f"[{number_text(joint.lower, 6)} rad, {number_text(joint.upper, 6)} rad]"
        way = {"zero": f"{number_text(joint.zero, 6)} rad", "limits": limits, "reverse": str(joint.reverse).lower()}
    else:
        way = {"ticks": flow_mapping({key: str(value) for key, value in asdict(joint.ticks).items()})}
    power = {"speed": f"{number_text(joint.speed, 6)} rad/s", "torque": f"{number_text(100 * joint.torque, 4)} %"}
    return flow_mapping({"id": str(joint.id), "model": joint.model}, way, power)


@click.command("import", cls=SharingCommand, epilog="Example: mission servo import joints.yaml -o my_robot.yaml")
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--model", help="Servo model (these files do not contain it); by default AX-12A, or STS3215 for a calibration."
)
@click.option(
    "--port", metavar="PATH", help="Port of the servos; by default /dev/u2d2, or /dev/ttyACM0 for a calibration."
)
@click.option(
    "--baud", type=WholeNumber(min=1), default=1_000_000, show_default=True, metavar="RATE", help="Baud rate."
)
@click.option("-o", "--output", type=click.Path(dir_okay=False, path_type=Path), metavar="NEW", help="New "
              "robot file; by default the text goes to stdout.")  # fmt: skip
@click.option("--into", type=click.Path(exists=True, dir_okay=False, path_type=Path), metavar="ROBOT", help="Robot "
              "file to which the joints are written.")  # fmt: skip
@arm_option
def import_joints(
    file: Path, model: str | None, port: str | None, baud: int, output: Path | None, into: Path | None, arm: str
) -> int:
    """Import joints from a file of ROS or LeRobot into a robot file.

    Reads a YAML file of dynamixel_controllers, ArbotiX, Interbotix or dynamixel_workbench, or a calibration of LeRobot.
    Positions in servo steps are not converted to angles. Changed and omitted keys are listed on stderr.
    """
    if model is not None and model not in (known := [*MODELS, *ALIASES]):
        raise click.UsageError(f"--model: '{model}' is not a known servo model; {suggest_from(model, known)}")
    if output is not None and into is not None:
        raise click.UsageError("-o and --into cannot be used together")
    found = _read_joints(file, model)
    if into is not None and found.calibration:
        raise click.UsageError(f"{file} is a calibration: write `calibration: {found.calibration}` in {into}")
    port = port or ("/dev/ttyACM0" if found.calibration else "/dev/u2d2")
    text = robot_text(file.stem, found.joints, port=port, baud=baud, arm=arm, calibration=found.calibration)
    try:
        if into is not None:
            _add_to_robot(into, found, text, arm)
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
        click.echo(f"{len(found.joints)} joints written to {output or into}", err=True)
    return SUCCESS


def _read_joints(file: Path, model: str | None) -> ForeignJoints:
    """Read the joints of a file. Raises click.UsageError for another kind of file, and InvalidFileError."""
    foreign = None if kinds_of(file) else recognise_file(file)
    if foreign is None or not foreign.form or foreign.form in MOVEMENT_FORMS:
        other = f"{file} has no joints in a form that is known here (dynamixel_controllers, ArbotiX, Interbotix, "
        other += "dynamixel_workbench, LeRobot); `mission robot new` makes a robot file of what is plugged in"
        raise click.UsageError(wrong_kind_error("joints", file) or other)
    usual = {"ros": "AX-12A", "arbotix": "AX-12A", "lerobot": "STS3215"}.get(foreign.form)
    if model is None and usual is None:
        raise click.UsageError(f"{file} is {foreign.description}: say what its servos are, such as --model XM430-W350")
    servos = ALIASES.get(model or "", model or usual or "")
    if foreign.form != "ros":
        return foreign_joints(file, foreign.form, servos)
    found = load_ros_joints(file, model=servos)
    return ForeignJoints(dict(found.joints), [str(note) for note in found.notes])


def _add_to_robot(path: Path, found: ForeignJoints, text: str, part: str) -> None:
    """Add the joints in ``text`` to the arm ``part`` of a robot file, and change nothing else.

    Raises NotEditableError if that is not possible, click.UsageError if the robot has arms, but none of that name.
    """
    require_own(path, "mission servo import JOINTS.yaml --into FILE")
    source = read_source(path)
    old = parse_robot(source)
    if part != DEFAULT_ARM:
        find_arm(old, part)
    before = arm_keys(old, part)
    joints: dict[str, JointKeys] = {} if before is None else dict(before.joints)
    if there := [name for name in found.joints if name in joints]:
        raise NotEditableError(f"{path}: it has {', '.join(there)} already")
    lines = text.partition("  joints:\n")[2].splitlines()
    new = source.text
    for line in reversed(lines):  # with_value inserts before the others
        name, _, value = line.strip().partition(": ")
        new = with_value(SourceText(source.name, new), (part, "joints", name), value)
    arm = arm_keys(parse_robot(SourceText(source.name, new)), part)
    if arm is None or dict(arm.joints) != {**found.joints, **joints}:
        raise NotEditableError(f"{path}: its {part} cannot be edited automatically; write the joints yourself")
    rewrite(path, new)
