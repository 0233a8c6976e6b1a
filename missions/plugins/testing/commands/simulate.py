"""``mission simulate``: a robot's virtual devices without a mission, on ports that any program can open."""

import json
import os
import select
import signal
import threading
from collections.abc import Iterator

import click

from config.diagnostics import suggest_from
from config.library import DEFAULT_ROBOT, find_file
from config.robot import RobotConfig
from config.units import si_value
from config.world import load_world
from drivers.api.joints import qualified_joint_name
from drivers.clock import SystemClock
from drivers.servos.declared import DynamixelKeys
from drivers.servos.joint import Joint
from drivers.servos.make import joint_specs
from drivers.servos.models import MODELS
from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.device import VirtualPort
from missions.assembly.simulation import Simulation
from missions.cli.commands import LazyGroup
from missions.cli.names import ROBOT, WORLD
from missions.cli.numbers import QuantityInUnit
from missions.cli.origin import robot_file
from missions.executive.executive import STOP_POLL_INTERVAL
from missions.library.drivers import load_robot

# What a person does to virtual devices, in words: `turn elbow 30 deg`, typed while `mission simulate` runs them.

JOINT_COMMANDS = {
    "turn": "JOINT ANGLE: turn a limp joint by hand, such as turn elbow 30 deg",
    "burden": "JOINT SHARE: load it with a share of its stall torque, such as burden elbow 40 %",
    "heat": "JOINT TEMPERATURE: set its servo's temperature, such as heat elbow 85 degC",
    "brown_out": "JOINT DURATION: interrupt its supply for this time, such as brown_out elbow 200 ms",
    "overload": "JOINT: make its servo shut down",
    "power": "JOINT: switch its power off and on",
    "remove": "JOINT: take its servo off the bus",
    "insert": "JOINT: put its servo on the bus again",
}
"""Commands for the servo of one joint, each with its arguments and meaning."""

COMMAND_HELP = JOINT_COMMANDS | {
    "unplug": "[PART]: unplug base, head, arm or another part; all parts by default",
    "plug": "[PART]: plug it in again",
    "help": "this list",
}
"""Help text of all commands, for one servo and for whole devices."""


class DeviceCommands:
    """Commands that act by hand on the virtual devices of an open simulation."""

    def __init__(self, simulation: Simulation, robot: RobotConfig) -> None:
        self._simulation = simulation
        self._joints: dict[str, tuple[str, Joint, VirtualServo]] = {}
        for part, plugged in simulation.parts.items():
            keys = robot.sections[part].keys
            if isinstance(keys, DynamixelKeys) and isinstance(plugged.device, VirtualServoBus):
                joint_list = (Joint(name, spec, MODELS[spec.model]) for name, spec in joint_specs(keys).items())
                for joint, servo in zip(
                    joint_list, plugged.device.servos, strict=True
                ):  # by order: the IDs may have changed
                    self._joints[qualified_joint_name(part, joint.name)] = part, joint, servo

    def run_command(self, line: str) -> str:
        """Run the command in ``line``; return a text to show. Raises ValueError for an invalid command."""
        verb, *rest = line.split()
        if verb in JOINT_COMMANDS:
            part, joint, servo = self._joint(rest[0] if rest else "")
            self._simulation.terminals[part].call_paused(lambda: act_on_servo(verb, joint, servo, " ".join(rest[1:])))
        elif verb in ("plug", "unplug"):
            for terminal in self._terminals(" ".join(rest)):
                terminal.unplug() if verb == "unplug" else terminal.replug()
        elif verb == "help":
            return "; ".join(f"{word} {what}" for word, what in COMMAND_HELP.items())
        else:
            raise ValueError(f"unknown command '{verb}'; {suggest_from(verb, COMMAND_HELP)}")
        return " ".join((verb, *rest))

    def _joint(self, name: str) -> tuple[str, Joint, VirtualServo]:
        if name not in self._joints:
            raise ValueError(f"no joint '{name}'; {suggest_from(name, self._joints) or 'this robot has none'}")
        return self._joints[name]

    def _terminals(self, part: str) -> list[VirtualPort]:
        terminals = self._simulation.terminals
        if part and part not in terminals:
            raise ValueError(f"no part '{part}' with a plug; {suggest_from(part, terminals)}")
        return [terminals[part]] if part else list(terminals.values())


def act_on_servo(verb: str, joint: Joint, servo: VirtualServo, value: str) -> None:
    """Act on a servo. Raises ValueError for an invalid value, or for a joint that resists."""
    match verb:
        case "turn" if servo.limp:
            servo.turn_by_hand(joint.spec.zero + joint.spec.direction * si_value(value, "angle"))
        case "turn":
            raise ValueError(
                f"{joint.title}: its torque is on, so it cannot be turned by hand; "
                "off: `mission servo torque off --port PORT`"
            )
        case "burden":
            servo.load = si_value(value, "share") * joint.spec.direction
        case "heat":
            servo.temperature = si_value(value, "temperature")
        case "brown_out":
            servo.brown_out(si_value(value, "duration"))
        case _ if value:
            raise ValueError(f"needs the name of a joint and nothing else, got '{value}' too")
        case "overload":
            servo.overload()
        case "power":
            servo.power_cycle()
        case "remove" | "insert":
            servo.present = verb == "insert"


class LineReader:
    """Reads whole lines from a file descriptor; yields no more lines after the end of the file."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._partial_line = b""
        self._open = True

    def wait(self, seconds: float) -> Iterator[str]:
        """Wait up to ``seconds`` for input; yield the complete lines."""
        try:
            ready = self._open and bool(select.select([self._descriptor], [], [], seconds)[0])
            data = os.read(self._descriptor, 4096) if ready else b""
        except (OSError, ValueError):  # closed, or a terminal that belongs to another program now
            ready, data = True, b""
        if ready and not data:
            self._open = False
        if not self._open:
            threading.Event().wait(seconds)
        *lines, self._partial_line = (self._partial_line + data).split(b"\n")
        yield from (line.decode(errors="replace").strip() for line in lines)


@click.group(
    "simulate",
    cls=LazyGroup,
    invoke_without_command=True,
    epilog="Example: mission simulate --robot turtlebot2",
)
@click.option("--robot", type=ROBOT, help=f"Robot: a name or a file; the default is {DEFAULT_ROBOT}.")
@click.option(
    "--state",
    "period",
    type=QuantityInUnit("s", 0.01),
    metavar="SECONDS",
    help="Interval at which to print the state of the devices as JSON.",
)
@click.option("--world", type=WORLD, help="World; the default is open floor.")
@click.option(
    "--ros2",
    "listen",
    is_flag=False,
    flag_value="tcp/127.0.0.1:7447",
    metavar="[ADDRESS]",
    help="Serve a robot of ROS 2 (turtlebot4, unless another is named) at this address: tcp/127.0.0.1:7447.",
)
@click.option("--paced", is_flag=True, help="Simulate the transmission time of bytes on the servo bus.")
@click.pass_context
def command(
    ctx: click.Context, robot: str | None, period: float | None, world: str | None, listen: str | None, paced: bool
) -> None:
    """Run the virtual devices of a robot and print their ports as one line of JSON, until Ctrl-C.

    The devices speak their real protocols: connect any program to them, or a `mission run` with --port. A line on stdin
    acts on a device: `turn elbow 30 deg`, `overload elbow`, `unplug`, `help`.
    """
    if ctx.invoked_subcommand is not None:
        return
    config = load_robot(robot_file(robot, DEFAULT_ROBOT if listen is None else "turtlebot4"))
    if listen is not None and "ros2" not in config.sections:
        raise click.UsageError(f"{config.name} is not a ROS 2 robot: mission simulate --ros2 --robot turtlebot4")
    around = None if world is None else load_world(find_file("worlds", world))
    clock = SystemClock()
    ending: list[int] = []  # a plain list: a signal handler must not take a lock that it may have interrupted
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda got, _: ending.append(got))
    signal.signal(signal.SIGTTIN, signal.SIG_IGN)  # in the background, nothing can be typed; that is no reason to stop
    simulation = Simulation(config, config.parts, clock, world=around, listen=listen or "")
    for plugged in simulation.parts.values():
        if isinstance(plugged.device, VirtualServoBus):
            plugged.device.paced = paced
    try:
        simulation.open()
        click.echo(json.dumps({"robot": config.name, "ports": simulation.ports}))
        hands, lines, reported_at = DeviceCommands(simulation, config), LineReader(0), clock.now()
        while not ending:
            for line in lines.wait(STOP_POLL_INTERVAL if period is None else min(STOP_POLL_INTERVAL, period)):
                if line:
                    _run_line(hands, line)
            if period is not None and clock.now() - reported_at >= period:
                reported_at = clock.now()
                click.echo(json.dumps({"t": round(reported_at, 3)} | simulation.state()))
    finally:
        simulation.close()


def _run_line(hands: DeviceCommands, line: str) -> None:
    """Run a typed command, and print its result as a line of JSON."""
    try:
        answer = {"done": hands.run_command(line)}
    except ValueError as error:
        answer = {"error": f"{line}: {error}"}
    click.echo(json.dumps(answer))
