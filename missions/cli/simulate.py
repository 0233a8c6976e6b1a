"""``mission simulate``: a robot's virtual devices alone, on ports that any program can open."""

import json
import signal
import threading

import click

from config.library import find
from config.robot import load_robot
from drivers.clock import SystemClock
from missions.assembly.simulation import WIRED, Simulation
from missions.executive.executive import GLANCE
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
    ending: list[int] = []  # a plain list: a signal handler must not take a lock that it may have interrupted
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda got, _: ending.append(got))
    simulation = Simulation(config, frozenset(WIRED) & config.parts, clock)
    try:
        simulation.open()
        click.echo(json.dumps({"robot": config.name, "ports": simulation.ports}))
        pause, told = threading.Event(), clock.now()
        while not ending:
            pause.wait(GLANCE if period is None else min(GLANCE, period))
            if period is not None and clock.now() - told >= period:
                told = clock.now()
                click.echo(json.dumps({"t": round(told, 3)} | simulation.state()))
    finally:
        simulation.close()
