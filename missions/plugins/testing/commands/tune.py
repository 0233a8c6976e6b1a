"""``mission controller tune``: searches better numbers for a controller in simulation."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from behaviours.tracking.fuzzy import RuleBases
from config.controller import name_changes, parse_controller, replace_words
from config.diagnostics import SourceText
from config.file_io import save_file
from config.library import find_file
from config.yaml_nodes import read_source
from missions.cli.console import console
from missions.cli.keys import interruptible
from missions.cli.names import CONTROLLER
from missions.cli.numbers import WholeNumber
from missions.cli.outputs import report_write_errors
from missions.cli.root import INTERRUPTED, SUCCESS
from missions.plugins.testing.commands.controller import read_controller
from missions.plugins.testing.controllers.bench import run_bench, table_lines
from missions.plugins.testing.controllers.tracking_trial import SCENARIOS

RULES = ("pan", "turn")
"""Rule bases that can be tuned."""


@click.command(epilog="Example: mission controller tune face --evaluations 50")
@click.argument("name", type=CONTROLLER, metavar="[CONTROLLER]", default="face")
@click.option(
    "--rules",
    type=click.Choice(RULES),
    multiple=True,
    help="Rules to tune: pan (of the head), turn (of a base without a head). Repeatable; both by default.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="File of the new controller; NAME_tuned.yaml by default.",
)
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@click.option(
    "--evaluations",
    type=WholeNumber(min=10),
    default=300,
    show_default=True,
    metavar="N",
    help="Number of variants to try.",
)
@click.option("--seed", type=WholeNumber(min=0), default=0, show_default=True, help="Random seed of the search.")
def tune(name: str, rules: tuple[str, ...], output: Path | None, force: bool, evaluations: int, seed: int) -> int:
    """Tune the numbers of a controller (a name or a file; face by default), and write them to a new file.

    Uses differential evolution: tries variants on the simulated robot in two scenarios of `mission controller bench`,
    step and walk, and combines the best ones. The same command finds the same numbers. The rest of the file stays
    unchanged. If the search is interrupted, the new file has the best numbers so far.
    """
    try:
        from missions.plugins.testing.controllers.tuning import ControllerTuning  # noqa: PLC0415 - an extra, and slow to import
    except ImportError as error:
        raise click.UsageError("tuning needs SciPy: pip install 'missiontree[tune]'") from error
    path = find_file("controllers", name)
    config, before = read_controller(name)
    output = output or Path(f"{path.stem}_tuned.yaml")
    if output.exists() and not force:
        raise click.UsageError(f"'{output}' exists: name another file with --output, or add --force")
    chosen = tuple(dict.fromkeys(rules)) or tuple(each for each in RULES if each in config.values)
    source = read_source(path)
    kept: list[str] = []

    def keep(text: str) -> None:
        """Write the best text so far to the file, which stays if the search is interrupted."""
        found = SourceText(source.name, text)
        kept.append(replace_words(found, name_changes(found, output.stem, f"{config.summary} Tuned.")))
        with report_write_errors(output, "-o"):
            save_file(output, kept[-1])

    try:
        with interruptible(), _progress(evaluations) as on_cost:
            for each in chosen:
                tuning = ControllerTuning(source, each)
                found = tuning.search(evaluations // len(chosen), seed=seed, on_cost=on_cost, on_better=keep)
                source = SourceText(source.name, found.text)
    except KeyboardInterrupt:
        if not kept:
            raise
        click.echo(f"mission: interrupted; {output} has the best numbers so far", err=True)
        return INTERRUPTED
    except ValueError as error:
        raise click.UsageError(str(error)) from error
    text = replace_words(source, name_changes(source, output.stem, f"{config.summary} Tuned."))
    after = RuleBases.from_mapping(parse_controller(SourceText(str(output), text)).values)
    for line in table_lines(list(run_bench({"before": before, "after": after}, scenarios=SCENARIOS[:2]))):
        click.echo(line)
    with report_write_errors(output, "-o"):
        save_file(output, text)
    click.echo(f"\nwrote {output}; to use it: track_face: {output}")
    return SUCCESS


@contextmanager
def _progress(evaluations: int) -> Iterator[Callable[[float], None]]:
    """Show the number of variants tried and the lowest cost on a terminal."""
    shown = console(sys.stderr)
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("least cost {task.fields[least]:.2f}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal) as progress:
        task = progress.add_task("", total=evaluations, least=float("inf"))

        def on_cost(cost: float) -> None:
            progress.update(task, advance=1, least=min(cost, progress.tasks[0].fields["least"]))

        yield on_cost
