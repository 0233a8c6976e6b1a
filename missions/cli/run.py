"""``mission run``: a mission on a robot, simulated unless one is named."""

import json
import logging
import sys
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TextIO

import click

from config.faults import InvalidFileError
from config.library import UnknownNameError
from drivers.errors import DriverError
from missions.cli.live import Watcher
from missions.cli.options import pairs, params_option
from missions.cli.root import DEVICE, FAILURE, INTERRUPTED, SUCCESS
from missions.executive.events import JsonLines, Listener
from missions.executive.executive import Result
from missions.runner import Order, Runner

EXIT_CODES = {"success": SUCCESS, "failure": FAILURE, "interrupted": INTERRUPTED, "error": DEVICE}


@click.command()
@click.argument("name", metavar="MISSION")
@params_option
@click.option("--robot", metavar="NAME", help="The robot to run on (a name or a file); it moves, unless --simulate.")
@click.option("--simulate", is_flag=True, help="Simulate the robot. This is the default where no --robot is named.")
@click.option("--world", metavar="NAME", help="What a simulated robot stands in (a name or a file).")
@click.option("--camera", metavar="SOURCE", help="A video, folder, URL, device or index instead of the robot's camera.")
@click.option(
    "--port",
    "ports",
    multiple=True,
    metavar="PART=PORT",
    callback=pairs("base=/dev/ttyUSB0"),
    help="Where a part is plugged in, instead of what the robot file says.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="For whatever is drawn by chance.")
@click.option(
    "--events", type=click.Path(dir_okay=False, path_type=Path), help="Write every event here, as JSON lines."
)
@click.option("--json", "as_json", is_flag=True, help="End with one line of JSON on stdout; the rest goes to stderr.")
def command(
    name: str,
    params: dict[str, str],
    robot: str | None,
    simulate: bool,
    world: str | None,
    camera: str | None,
    ports: dict[str, str],
    seed: int,
    events: Path | None,
    as_json: bool,
) -> int:
    """Run a mission (a name or a file). Ctrl-C stops it, safely.

    Exit code 0 is success, 1 failure, 2 a mistake in the command or a file, 3 a device, 130 interrupted.
    """
    order = Order(name, params, robot, simulate, world, camera, ports, seed)
    try:
        result = run(order, events, sys.stderr if as_json else sys.stdout)
    except (InvalidFileError, UnknownNameError, DriverError) as error:
        if as_json:
            click.echo(json.dumps(asdict(Result(name, "error", str(error), 0.0, 0))))
        raise
    if as_json:
        click.echo(json.dumps(asdict(result)))
    return EXIT_CODES[result.result]


def run(order: Order, events: Path | None, out: TextIO) -> Result:
    """Run ``order``, show on ``out`` what happens, and write the events."""
    with ExitStack() as closing:
        listeners: list[Listener] = []
        if events is not None:
            try:
                listeners.append(JsonLines(closing.enter_context(events.open("w", encoding="utf-8"))))
            except OSError as error:
                raise click.BadParameter(f"{events}: {error.strerror}", param_hint="--events") from error
        watcher = closing.enter_context(Watcher(out))
        runner = Runner(order, listeners=[*listeners, watcher], out=watcher.say)
        watcher.root = runner.root
        logging.getLogger("missiontree").addHandler(watcher.log_handler)
        closing.callback(logging.getLogger("missiontree").removeHandler, watcher.log_handler)
        return runner.run()
