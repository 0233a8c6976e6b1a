"""``mission simulate``: a robot's virtual devices alone, on ports that any program can open."""

import json
import signal
import threading

import click

from config.library import find
from config.robot import load_robot
from drivers.clock import SystemClock
from missions.assembly.simulation import WIRED, Simulation
from missions.runner import DEFAULT_ROBOT


@click.command()
@click.option("--robot", metavar="NAME", default=DEFAULT_ROBOT, show_default=True, help="A name or a file.")
@click.option(
    "--state", "period", type=float, metavar="SECONDS", help="Print what the devices do, as JSON, that often."
)
def command(robot: str, period: float | None) -> None:
    """Run the virtual devices of a robot, and print their ports as one line of JSON. Ctrl-C ends them.

    The devices speak their real protocols: point any program at them, or another `mission run` with --port.
    """
    config = load_robot(find("robots", robot))
    clock = SystemClock()
    ending = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: ending.set())
    simulation = Simulation(config, frozenset(WIRED) & config.parts, clock)
    try:
        simulation.open()
        click.echo(json.dumps({"robot": config.name, "ports": simulation.ports}))
        while not ending.wait(period):
            click.echo(json.dumps({"t": round(clock.now(), 3)} | simulation.state()))
    finally:
        simulation.close()
