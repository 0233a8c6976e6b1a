"""``mission controller``: shows, compares and tunes the controllers of behaviours."""

import json
from collections.abc import Callable
from pathlib import Path

import click

from behaviours.tracking.fuzzy import RuleBases
from behaviours.tracking.track import TrackFace
from config.controller import ControllerConfig, load_controller
from config.library import find_file
from missions.cli.commands import LazyGroup
from missions.cli.names import CONTROLLER
from missions.cli.numbers import WholeNumber
from missions.cli.outputs import report_write_errors
from missions.plugins.pictures.png import PLOTS_MISSING
from missions.plugins.testing.controllers.bench import (
    DEFAULT_CONTROLLERS,
    DELAY_CONTROLLERS,
    NO_MOTION,
    delay_summary,
    describe_controller,
    run_bench,
    stamp_summary,
    table_lines,
)
from missions.plugins.testing.controllers.tracking_trial import DELAY_SCENARIOS, STAMP_SCENARIOS

DEFAULT_LAG = TrackFace.lag
"""Default lag of a base in seconds until the lag is measured, as in missions."""


picture_option = click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.png",
    help="Also draw a picture to this file.",
)


@click.group(
    "controller",
    cls=LazyGroup,
    epilog="Example: mission controller show face",
)
def command() -> None:
    """Show, compare and tune the controllers that keep a face or person in view.

    `mission list controllers` lists them.
    """


@command.command(epilog="Example: mission controller show face -o face.png")
@click.argument("name", type=CONTROLLER, metavar="CONTROLLER")
@picture_option
def show(name: str, output: Path | None) -> None:
    """Show and draw a controller, given by name or file.

    Draws its membership functions and control surfaces.
    """
    config, _ = read_controller(name)
    for line in describe_controller(config):
        click.echo(line)
    if output is not None:
        try:
            from missions.plugins.testing.controllers.plots import draw_controller  # noqa: PLC0415 - an extra, and slow to import
        except ImportError as error:
            raise click.UsageError(PLOTS_MISSING) from error
        _draw_picture(output, lambda: draw_controller(output, config))


@command.command(name="bench", epilog="Example: mission controller bench face pd --delays --seeds 1")
@click.argument("names", type=CONTROLLER, metavar="[CONTROLLER]...", nargs=-1)
@picture_option
@click.option("--json", "as_json", is_flag=True, help="Print the figures as one JSON list: seconds and degrees.")
@click.option(
    "--seed", type=WholeNumber(min=0), default=0, show_default=True, help="Seed of the noise and of lost pictures."
)
@click.option("--delays", is_flag=True, help="Use scenarios with unknown delays and unforeseeable motion.")
@click.option("--stamps", is_flag=True, help="Use scenarios with jittering time stamps and a changing camera delay.")
@click.option(
    "--seeds", type=WholeNumber(min=1), default=3, show_default=True, help="Number of seeds, with --delays or --stamps."
)
def bench_(
    names: tuple[str, ...], output: Path | None, as_json: bool, seed: int, delays: bool, stamps: bool, seeds: int
) -> None:
    """Compare controllers in tracking a face.

    Names or files; by default course, pd, mamdani and face.

    The trials run in simulated time, with the speeds, the inertia and the whole degrees of the servos of a TurtleBot
    with a Rodney head: the head alone, the base alone with the camera on it, and both. --delays and --stamps take
    minutes.
    """
    chosen = names or (DELAY_CONTROLLERS if delays else DELAY_CONTROLLERS[1::2] if stamps else DEFAULT_CONTROLLERS)
    rules = {Path(name).stem if Path(name).suffix else name: read_controller(name)[1] for name in chosen}
    if delays or stamps:
        if delays:
            rules["standing"] = NO_MOTION
        scenarios, sum_up = (DELAY_SCENARIOS, delay_summary) if delays else (STAMP_SCENARIOS, stamp_summary)
        rows = [
            row for n in range(seeds) for row in run_bench(rules, scenarios=scenarios, seed=seed + n, lag=DEFAULT_LAG)
        ]
        lines = json.dumps([row.as_dict() for row in rows], indent=2).splitlines() if as_json else sum_up(rows)
        for line in lines:
            click.echo(line)
        return
    rows = list(run_bench(rules, seed=seed))
    if as_json:
        click.echo(json.dumps([row.as_dict() for row in rows], indent=2))
    else:
        for line in table_lines(rows):
            click.echo(line)
    if output is not None:
        try:
            from missions.plugins.testing.controllers.plots import draw_bench  # noqa: PLC0415 - an extra, and slow to import
        except ImportError as error:
            raise click.UsageError(PLOTS_MISSING) from error
        _draw_picture(output, lambda: draw_bench(output, rows))


def read_controller(name: str) -> tuple[ControllerConfig, RuleBases]:
    """Return a controller by name or path. Raises click.UsageError for invalid rules."""
    config = load_controller(find_file("controllers", name))
    try:
        return config, RuleBases.from_mapping(config.values)
    except ValueError as error:
        raise click.UsageError(f"controller '{name}': {error}") from error


def _draw_picture(output: Path, draw: Callable[[], None]) -> None:
    if output.suffix != ".png":
        raise click.UsageError(f"'{output}': the file name must end in .png")
    with report_write_errors(output, "-o"):
        draw()
    click.echo(f"drew {output}", err=True)
