"""``mission sweep``: runs one mission many times with varied seeds and values, and summarises the results."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from config.defaults import load_defaults
from config.units import si_value
from drivers.clock import SystemClock
from missions.cli.console import console
from missions.cli.keys import interruptible
from missions.cli.names import MISSION
from missions.cli.numbers import WholeNumber
from missions.cli.option_declarations import add_options, behaviours_option, params_option, run_options
from missions.cli.options import name_value_callback
from missions.cli.origin import chosen_robot
from missions.cli.root import FAILURE, INTERRUPTED, SUCCESS
from missions.cli.running import EXIT_CODES
from missions.cli.running import run as run_watched
from missions.plugins.testing.sweep.files import PICTURE, RUNS, SUMMARY, SweepFolder, write_world
from missions.plugins.testing.sweep.parameters import parameter_names
from missions.plugins.testing.sweep.processes import run_here
from missions.plugins.testing.sweep.report import percent, report
from missions.plugins.testing.sweep.summary import Summary, summarise
from missions.plugins.testing.sweep.sweep import SweepPlan, SweepRequest, VariationError, describe_draw, design_sweep
from missions.plugins.testing.sweep.variation import SweepRow
from missions.plugins.testing.worker_pool import core_count


def _quantity_reader(dimension: str) -> Callable[[click.Context, click.Parameter, str | None], float | None]:
    """Return a click callback that reads a quantity of a dimension."""

    def read(ctx: click.Context, option: click.Parameter, value: str | None) -> float | None:
        try:
            return None if value is None else si_value(value, dimension)
        except ValueError as error:
            raise click.BadParameter(str(error), ctx=ctx, param=option) from error

    return read


@click.command(epilog="Example: mission sweep greet --runs 20 --vary person.distance='0.6..2.5 m'")
@click.argument("name", type=MISSION, metavar="MISSION")
@click.option("--runs", type=WholeNumber(min=1), default=100, show_default=True, help="Number of runs.")
@click.option(
    "--vary",
    multiple=True,
    metavar="NAME=VALUES",
    callback=name_value_callback('person.distance="0.6 m..3 m"'),
    help="Vary a parameter: each run draws it from a range (a..b) or a list (a,b,c). Repeatable. "
    f"NAME is one of {', '.join(parameter_names())}; person2 is the second person of the world, and so on.",
)
@params_option
@behaviours_option
@add_options(
    *(replace(each, help="Robot to simulate: a name or a file; no hardware is used.") for each in run_options("robot")),
    *run_options("world", "physics"),
    *(replace(each, default="truth") for each in run_options("eyes")),
    *(replace(each, help="Seed of the first run; each further run adds one.") for each in run_options("seed")),
)
@click.option(
    "--limit",
    metavar="TIME",
    default="300 s",
    show_default=True,
    callback=_quantity_reader("duration"),
    help="Time limit of a run in simulated time; beyond it, the run counts as unfinished.",
)
@click.option(
    "-j", "--jobs", type=WholeNumber(min=1), metavar="N", help="Number of processes; the default is one for each core."
)
@click.option(
    "--target",
    metavar="SHARE",
    callback=_quantity_reader("share"),
    help='Exit with 1 if the lower bound of the success rate\'s confidence interval is below this, such as "95 %".',
)
@click.option(
    "-o",
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Folder for the files; sweep-MISSION by default.",
)
@click.option("--force", is_flag=True, help="Overwrite the files of an earlier sweep.")
@click.option("--only", type=WholeNumber(min=0), metavar="SEED", help="Run only the run with this seed, and watch it.")
@click.option(
    "--save-world",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="With --only: write the world of that run to this file, for `mission run --world FILE`.",
)
def command(
    name: str,
    runs: int,
    vary: dict[str, str],
    params: dict[str, str],
    files: tuple[Path, ...],
    robot: str | None,
    world: str | None,
    eyes: Literal["pixels", "truth"],
    physics: bool,
    seed: int,
    limit: float,
    jobs: int | None,
    target: float | None,
    output: Path | None,
    force: bool,
    only: int | None,
    save_world: Path | None,
) -> int:
    """Run a mission (a name or a file) many times in simulated time; report how often it succeeds and why it fails.

    Writes every run (runs.csv), the summary (summary.json), a picture (sweep.png) and the worlds of the worst runs. Run
    number i has the seed SEED + i, which determines all its values, so each run can be repeated alone.

    Exit codes: 0 the sweep ran; 1 it missed its --target; 2 an error in the command or a file; 130 interrupted, with
    the finished runs reported and written.
    """
    if save_world is not None and only is None:
        raise click.UsageError("--save-world needs --only SEED")
    try:
        robot, world = chosen_robot(robot), world or load_defaults().world or None
        sweep, plan = design_sweep(SweepRequest(name, vary, params, robot, world, files, eyes, limit, physics))
    except VariationError as error:
        raise click.BadParameter(str(error), param_hint="--vary") from error
    if only is not None:
        return _watch(sweep, only, save_world)
    folder = SweepFolder(output or Path(f"sweep-{plan.mission}"))
    try:
        folder.prepare(force=force)
    except FileExistsError as error:
        raise click.UsageError(f"{error}: name another folder with --output, or add --force") from error
    except OSError as error:
        raise click.UsageError(f"{folder.path}: {error.strerror}") from error
    clock = SystemClock()
    jobs = jobs or core_count()
    with interruptible():
        rows = _run(sweep, range(seed, seed + runs), jobs, partial(folder.append_row, sweep))
        took = f"{clock.now():.1f} s on {jobs} process{'es' if jobs > 1 else ''}"
        summary = summarise(rows, sweep.variations)
        _report(sweep, folder, plan.mission, rows, summary, took)
    if len(rows) < runs:
        click.echo(f"mission: interrupted; {runs - len(rows)} runs are missing", err=True)
        return INTERRUPTED
    low, _ = summary.rate.interval
    if target is not None and low < target:
        click.echo(f"mission: the success rate may be as low as {percent(low)}: below {percent(target)}", err=True)
        return FAILURE
    return SUCCESS


def _run(sweep: SweepPlan, seeds: range, jobs: int, keep: Callable[[SweepRow], None]) -> list[SweepRow]:
    """Run all seeds of a sweep, until Ctrl-C, SIGTERM or a hang-up; ``keep`` gets each row. Return the rows by seed."""
    found: list[SweepRow] = []
    with closing(run_here(sweep, seeds, jobs)) as work, _progress(len(seeds)) as progress:
        try:
            for row in work:
                keep(row)
                found.append(row)
                progress(found)
        except KeyboardInterrupt:
            pass  # fewer rows than seeds say so
    return sorted(found, key=lambda row: row.seed)


@contextmanager
def _progress(runs: int) -> Iterator[Callable[[Sequence[SweepRow]], None]]:
    """Show a progress bar with the number of successes on a terminal."""
    shown = console(sys.stderr)
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[good]} succeeded"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal) as progress:
        task = progress.add_task("", total=runs, good=0)

        def on_row(rows: Sequence[SweepRow]) -> None:
            good = progress.tasks[0].fields["good"] + (rows[-1].result == "success")
            progress.update(task, completed=len(rows), good=good)

        yield on_row


def _report(
    sweep: SweepPlan, folder: SweepFolder, mission: str, rows: Sequence[SweepRow], summary: Summary, took: str
) -> None:
    """Write a sweep's files, print its table, and draw the picture.

    The files are written before printing, which fails if the terminal has been closed.
    """

    def again(row: SweepRow) -> tuple[str, str]:
        world = folder.world_file(row.seed)
        return describe_draw(sweep, row.values), sweep.command(row.seed, world) if world.exists() else ""

    if rows:
        about = {"mission": mission, "world": sweep.file, "eyes": sweep.eyes, "limit": sweep.limit}
        folder.write(sweep, rows, summary, about)
    click.echo(f"{mission} in {sweep.file}: {len(rows)} runs, eyes: {sweep.eyes}; {took}\n")
    if not rows:
        return
    click.echo(report(summary, again))
    written = [RUNS, SUMMARY]
    try:
        from missions.plugins.testing.sweep.picture import draw_sweep  # noqa: PLC0415 - an extra, and slow to import
    except ImportError:
        click.echo("mission: no picture without Matplotlib: pip install 'missiontree[plots]'", err=True)
    else:
        draw_sweep(folder.path / PICTURE, mission, summary, rows)
        written.append(PICTURE)
    click.echo(f"\nwritten to {folder.path}/: {', '.join(written)}")


def _watch(sweep: SweepPlan, seed: int, save_world: Path | None) -> int:
    """Run one seed as ``mission run`` does, and print the command that repeats it."""
    click.echo(f"run {seed}: {describe_draw(sweep, sweep.draw(seed)) or 'nothing varied'}")
    if save_world is not None:
        write_world(sweep, seed, save_world)
        click.echo(sweep.command(seed, save_world))
    result = run_watched(sweep.request(seed), sys.stdout, lambda _: None)
    return EXIT_CODES[result.result]
