"""``mission simulate``: a robot's virtual devices alone, on ports that any program can open."""

import json
import os
import select
import signal
import threading
from collections.abc import Iterator

import click

from config.library import DEFAULT_ROBOT, find
from config.world import load_world
from drivers.clock import SystemClock
from drivers.virtual.dynamixel import VirtualServoBus
from missions.assembly.simulation import Simulation
from missions.cli.hands import Hands
from missions.cli.names import ROBOT, WORLD
from missions.cli.numbers import InUnit
from missions.cli.origin import robot_file
from missions.executive.executive import GLANCE
from missions.library.drivers import load_robot


class Lines:
    """Whole lines from a descriptor, as they come; at its end, or where there is none, none come."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._begun = b""
        self._open = True

    def wait(self, seconds: float) -> Iterator[str]:
        """Wait for so long, or until something comes; yield the lines that are whole by then."""
        try:
            ready = self._open and bool(select.select([self._descriptor], [], [], seconds)[0])
            data = os.read(self._descriptor, 4096) if ready else b""
        except (OSError, ValueError):  # closed, or a terminal that belongs to another program now
            ready, data = True, b""
        if ready and not data:
            self._open = False
        if not self._open:
            threading.Event().wait(seconds)
        *lines, self._begun = (self._begun + data).split(b"\n")
        yield from (line.decode(errors="replace").strip() for line in lines)


@click.command(epilog="Example: mission simulate --robot turtlebot2")
@click.option("--robot", type=ROBOT, help=f"A name or a file; else {DEFAULT_ROBOT}.")
@click.option(
    "--state",
    "period",
    type=InUnit("s", 0.01),
    metavar="SECONDS",
    help="Print what the devices do, as JSON, so often.",
)
@click.option("--world", type=WORLD, help="The world around it; else open floor.")
@click.option(
    "--ros2",
    "listen",
    is_flag=False,
    flag_value="tcp/127.0.0.1:7447",
    metavar="[ADDRESS]",
    help="Serve a robot of ROS 2 (turtlebot4, unless another is named) at this address: tcp/127.0.0.1:7447.",
)
@click.option("--paced", is_flag=True, help="Let bytes on the servo bus take the time that they take on a real one.")
def command(robot: str | None, period: float | None, world: str | None, listen: str | None, paced: bool) -> None:
    """Run the virtual devices of a robot, and print their ports as one line of JSON. Ctrl-C ends them.

    The devices speak their real protocols: point any program at them, or another `mission run` with --port.
    Meanwhile a line on stdin does something to them: `turn elbow 30 deg`, `overload elbow`, `unplug`, `help`.
    """
    config = load_robot(robot_file(robot, DEFAULT_ROBOT if listen is None else "turtlebot4"))
    if listen is not None and "ros2" not in config.sections:
        raise click.UsageError(f"{config.name} is no robot of ROS 2: mission simulate --ros2 --robot turtlebot4")
    around = None if world is None else load_world(find("worlds", world))
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
        hands, lines, told = Hands(simulation, config), Lines(0), clock.now()
        while not ending:
            for line in lines.wait(GLANCE if period is None else min(GLANCE, period)):
                if line:
                    _do(hands, line)
            if period is not None and clock.now() - told >= period:
                told = clock.now()
                click.echo(json.dumps({"t": round(told, 3)} | simulation.state()))
    finally:
        simulation.close()


def _do(hands: Hands, line: str) -> None:
    """Carry out what was typed, and say so: in a line of JSON, as all that is said here."""
    try:
        told = {"done": hands.do(line)}
    except ValueError as error:
        told = {"error": f"{line}: {error}"}
    click.echo(json.dumps(told))
