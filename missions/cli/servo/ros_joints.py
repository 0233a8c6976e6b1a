"""The joints of a robot as the ROS stack ``dynamixel_controllers`` describes them, read as joints of ours.

Its YAML has one controller a joint, with the servo's steps at the joint's 0 (``init``) and at its ends::

    elbow_controller:
      controller: {package: dynamixel_controllers, module: joint_position_controller, type: JointPositionController}
      joint_name: elbow
      joint_speed: 1.0                 # rad/s, 1 where it is not given; joint_max_speed is the most that it may be
      joint_torque_limit: 0.8          # of the servo's torque
      motor: {id: 4, init: 512, min: 819, max: 205}     # min above max: mounted the other way round

What it does not say is the model of the servo: that is for the caller to know.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path

from config.faults import Fault, InvalidFileError, Source
from config.fields import Fields, fields_of
from config.marked import read_source
from config.units import seen
from drivers.dynamixel.declared import JointKeys, Ticks, last_id
from drivers.dynamixel.models import MODELS, Model

LEFT_OUT = {
    "joint_compliance_slope": "the compliance of a servo stays as it is",
    "joint_compliance_margin": "the compliance of a servo stays as it is",
    "joint_compliance_punch": "the compliance of a servo stays as it is",
}
"""What has no place in a robot file, and what is done instead."""

UNLIKE = {
    "JointTorqueController": "turns a wheel, and takes no positions",
    "JointTorqueControllerDualMotor": "turns wheels, and takes no positions",
    "JointPositionControllerDualMotor": "moves one joint with two servos: make it two joints",
    "JointTrajectoryActionController": "leads other controllers, and is no joint",
}
"""The types of controller that are no joints of ours, and why."""


@dataclass(frozen=True, slots=True)
class RosJoints:
    """The joints by name; and what was changed or left out, each at its place in the file."""

    joints: Mapping[str, JointKeys]
    notes: tuple[Fault, ...]


def load_ros_joints(path: Path, *, model: str = "AX-12A") -> RosJoints:
    """Read the controllers of a file; all its servos are of ``model``. Raises InvalidFileError with every mistake."""
    return ros_joints_of(read_source(path), model=model)


def ros_joints_of(source: Source, *, model: str = "AX-12A") -> RosJoints:
    """Read the text of such a file. Raises as ``load_ros_joints`` does, and KeyError for an unknown model."""
    fields = fields_of(source, what="a file of controllers")
    reader = _Reader(MODELS[model])
    for key, node in fields.entries():
        reader.take(key.text, Fields(source, node, fields.faults, what=f"controller '{key.text}'"))
    if not reader.joints and not fields.faults:
        fields.fault(fields.node.mark, "there is no controller of a joint in it")
    if fields.faults:
        raise InvalidFileError(fields.faults)
    return RosJoints(reader.joints, tuple(reader.notes))


class _Reader:
    """Gathers the joints of one file, and what is to be said of them."""

    def __init__(self, model: Model) -> None:
        self.joints: dict[str, JointKeys] = {}
        self.notes: list[Fault] = []
        self._model = model
        self._named: dict[str, str] = {}
        self._numbered: dict[int, str] = {}

    def take(self, controller: str, fields: Fields) -> None:
        """Read one controller."""
        if _unlike(fields):
            return
        mistakes = len(fields.faults)
        name = fields.text("joint_name")
        motor = fields.section("motor", required=True)
        speed = min(fields.number("joint_speed", 1.0, low=0.02), fields.number("joint_max_speed", inf, low=0.02))
        torque = fields.number("joint_torque_limit", 1.0, low=0.01, high=1.0)
        for key, instead in LEFT_OUT.items():
            self._leave_out(fields, key, instead)
        fields.done()
        if motor is None:
            return
        number, ticks = motor.integer("id", low=0, high=last_id(self._model)), self._ticks(motor)
        self._leave_out(motor, "acceleration", "the acceleration of a servo stays as it is")
        motor.done()
        if len(fields.faults) > mistakes:
            return
        _once(fields, "joint_name", f"joint '{name}'", self._named.setdefault(name, controller), controller)
        _once(motor, "id", f"servo {number}", self._numbered.setdefault(number, controller), controller)
        model = self._model.name
        self.joints[name] = JointKeys(id=number, written_model=model, speed=speed, torque=torque, ticks=ticks)

    def _ticks(self, motor: Fields) -> Ticks:
        """Read the steps at the joint's 0 and at its ends, which are brought within those that the servo has."""
        mistakes = len(motor.faults)
        init = motor.integer("init", low=0, high=self._model.last)
        ticks = Ticks(init=init, min=self._end(motor, "min"), max=self._end(motor, "max"))
        if ticks.min == ticks.max and len(motor.faults) == mistakes:
            motor.fault(motor.node.mark, f"'min' and 'max' are both {ticks.min}: the joint could not move")
        if not min(ticks.min, ticks.max) <= init <= max(ticks.min, ticks.max):
            ends = f"'min' {ticks.min} and 'max' {ticks.max}"
            self._note(motor, "init", f"'init' {init} lies outside {ends}: the joint cannot go to its 0")
        return ticks

    def _end(self, motor: Fields, key: str) -> int:
        written = motor.integer(key)
        found = min(max(written, 0), self._model.last)
        if found != written:
            self._note(
                motor, key, f"'{key}' is {found} and not {written}: an {self._model.name} has 0..{self._model.last}"
            )
        return found

    def _leave_out(self, fields: Fields, key: str, instead: str) -> None:
        if fields.node_of(key) is not None:
            self._note(fields, key, f"'{key}' is left out: {instead}")

    def _note(self, fields: Fields, key: str, message: str) -> None:
        node = fields.node_of(key)
        self.notes.append(Fault(fields.source, (node or fields.node).mark, message))


def _unlike(fields: Fields) -> bool:
    """Note a controller that is no joint of ours, and return True for it."""
    section = fields.section("controller")
    kind = section.text("type", "JointPositionController") if section is not None else "JointPositionController"
    twin = fields.node_of("motor_master") or fields.node_of("motor_slave")
    if section is not None and kind != "JointPositionController":
        node = section.node_of("type") or section.node
        why = UNLIKE.get(kind, "is unknown")
        fields.fault(node.mark, f"{fields.what}: a {seen(kind)} {why}", "take it out of the file")
        return True
    if twin is not None:
        why = "a joint of two servos (motor_master, motor_slave) cannot be had"
        fields.fault(twin.mark, f"{fields.what}: {why}", "make it two joints")
        return True
    if section is not None:
        section.text("package", "")
        section.text("module", "")
        section.done()
    return False


def _once(fields: Fields, key: str, what: str, first: str, controller: str) -> None:
    """Note what another controller has already."""
    node = fields.node_of(key)
    if first != controller and node is not None:
        fields.fault(node.mark, f"{what} belongs to controller '{first}' already")
