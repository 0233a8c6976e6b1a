"""What a person does to virtual devices, in words: `turn elbow 30 deg`, typed while `mission simulate` runs them."""

from config.faults import one_of
from config.robot import RobotConfig
from config.units import in_dimension
from drivers.api.joints import joint_called
from drivers.dynamixel.declared import DynamixelKeys
from drivers.dynamixel.joint import Joint
from drivers.dynamixel.make import joints
from drivers.dynamixel.models import MODELS
from drivers.virtual.dynamixel import VirtualServoBus
from drivers.virtual.plugged import Socket
from drivers.virtual.servo import VirtualServo
from missions.assembly.simulation import Simulation

ON_JOINTS = {
    "turn": "JOINT ANGLE: turn a limp joint by hand, such as turn elbow 30 deg",
    "burden": "JOINT SHARE: load it with a share of its stall torque, such as burden elbow 40 %",
    "heat": "JOINT TEMPERATURE: make its servo so warm, such as heat elbow 85 degC",
    "brown_out": "JOINT DURATION: let its supply break down for so long, such as brown_out elbow 200 ms",
    "overload": "JOINT: let its servo shut itself down",
    "power": "JOINT: switch its power off and on",
    "remove": "JOINT: take its servo off the bus",
    "insert": "JOINT: put its servo on the bus again",
}
"""What can be done to a servo, and what the words behind it are."""

HELP = ON_JOINTS | {
    "unplug": "[PART]: pull the plug of base, head, arm or another; of all that there are without a name",
    "plug": "[PART]: put it in again",
    "help": "this list",
}
"""All that can be done."""


class Hands:
    """Does such things to the devices of a simulation that is open."""

    def __init__(self, simulation: Simulation, robot: RobotConfig) -> None:
        self._simulation = simulation
        self._joints: dict[str, tuple[str, Joint, VirtualServo]] = {}
        for part, plugged in simulation.parts.items():
            keys = robot.sections[part].keys
            if isinstance(keys, DynamixelKeys) and isinstance(plugged.device, VirtualServoBus):
                told = (Joint(name, spec, MODELS[spec.model]) for name, spec in joints(keys).items())
                for joint, servo in zip(told, plugged.device.servos, strict=True):  # whatever ID it has by now
                    self._joints[joint_called(part, joint.name)] = part, joint, servo

    def do(self, line: str) -> str:
        """Do what ``line`` says; return what to tell of it. Raises ValueError for words that make no sense."""
        verb, *rest = line.split()
        if verb in ON_JOINTS:
            part, joint, servo = self._joint(rest[0] if rest else "")
            self._simulation.terminals[part].ask(lambda: touch(verb, joint, servo, " ".join(rest[1:])))
        elif verb in ("plug", "unplug"):
            for terminal in self._terminals(" ".join(rest)):
                terminal.unplug() if verb == "unplug" else terminal.replug()
        elif verb == "help":
            return "; ".join(f"{word} {what}" for word, what in HELP.items())
        else:
            raise ValueError(f"unknown command '{verb}'; {one_of(verb, HELP)}")
        return " ".join((verb, *rest))

    def _joint(self, name: str) -> tuple[str, Joint, VirtualServo]:
        if name not in self._joints:
            raise ValueError(f"no joint '{name}'; {one_of(name, self._joints) or 'this robot has none'}")
        return self._joints[name]

    def _terminals(self, part: str) -> list[Socket]:
        terminals = self._simulation.terminals
        if part and part not in terminals:
            raise ValueError(f"no part '{part}' with a plug; {one_of(part, terminals)}")
        return [terminals[part]] if part else list(terminals.values())


def touch(verb: str, joint: Joint, servo: VirtualServo, value: str) -> None:
    """Do to a servo what ``verb`` says. Raises ValueError for a value that makes no sense, or a joint that resists."""
    match verb:
        case "turn" if servo.limp:
            servo.turn_by_hand(joint.spec.zero + joint.spec.direction * in_dimension(value, "angle"))
        case "turn":
            raise ValueError(f"{joint.title} is stiff: no hand can turn it")
        case "burden":
            servo.burden = in_dimension(value, "share") * joint.spec.direction
        case "heat":
            servo.temperature = in_dimension(value, "temperature")
        case "brown_out":
            servo.brown_out(in_dimension(value, "duration"))
        case _ if value:
            raise ValueError(f"needs the name of a joint and nothing else, got '{value}' too")
        case "overload":
            servo.overload()
        case "power":
            servo.power_cycle()
        case "remove" | "insert":
            servo.present = verb == "insert"
