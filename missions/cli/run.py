"""``mission run``: a mission on a robot, simulated unless one is named."""

import json
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TextIO

import click

from missions.cli.live import Watcher
from missions.cli.options import behaviours_option, pairs, params_option
from missions.cli.orders import check_events, check_order
from missions.cli.root import DEVICE, FAILURE, INTERRUPTED, SUCCESS
from missions.executive.events import JsonLines
from missions.executive.executive import Result
from missions.executive.watchdog import attempt_all
from missions.runner import Order, Runner, end_process

EXIT_CODES = {"success": SUCCESS, "failure": FAILURE, "interrupted": INTERRUPTED, "error": DEVICE}


@click.command()
@click.argument("name", metavar="MISSION")
@params_option
@behaviours_option
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
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="For whatever is drawn by chance."
)
@click.option(
    "--events", type=click.Path(dir_okay=False, path_type=Path), help="Write every event here, as JSON lines."
)
@click.option("--json", "as_json", is_flag=True, help="End with one line of JSON on stdout; the rest goes to stderr.")
def command(
    name: str,
    params: dict[str, str],
    files: tuple[Path, ...],
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
    order = Order(name, params, robot, simulate, world, camera, ports, seed, files)

    def last_words(result: Result) -> None:
        if as_json:
            click.echo(json.dumps(asdict(result)))

    try:
        result = run(order, events, sys.stderr if as_json else sys.stdout, last_words)
    except Exception as error:
        if as_json and not isinstance(error, click.ClickException):
            click.echo(json.dumps(asdict(Result(name, "error", str(error), 0.0, 0))))
        raise
    last_words(result)
    return EXIT_CODES[result.result]


def run(order: Order, events: Path | None, out: TextIO, last_words: Callable[[Result], None]) -> Result:
    """Run ``order``, show on ``out`` what happens, and write the events.

    ``last_words`` are said where a run that hangs for good ends the process.
    """
    check_order(order)
    watcher = Watcher(out)

    def give_up(result: Result) -> None:
        def say() -> None:
            watcher.__exit__(None, None, None)
            last_words(result)

        attempt_all({"last words": say}, 1.0)  # what hangs may hang on stdout: nothing here waits for that for ever
        end_process(result)

    # Reads and checks everything; nothing has been opened or written yet.
    runner = Runner(order, listeners=[watcher], give_up=give_up)
    watcher.watch(runner.root)
    with ExitStack() as closing:
        if events is not None:
            check_events(events, runner.plan)
            try:
                file = events.open("w", encoding="utf-8")
            except OSError as error:
                raise click.BadParameter(f"{events}: {error.strerror}", param_hint="--events") from error
            closing.callback(_close, file)
            runner.stream.listeners.append(JsonLines(file))
        with watcher:
            result = runner.run()
    for lost in runner.stream.lost:
        with suppress(OSError):
            click.echo(f"mission: not all events were told: {lost}", err=True)
    return result


def _close(file: TextIO) -> None:
    """Close a file that may be on a full disk: what could not be written has been told already."""
    with suppress(OSError):
        file.close()
