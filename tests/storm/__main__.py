"""Fault-injection fuzzing: ``python -m tests.storm`` plays random missions, robots, worlds and faults by seed."""

import signal
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import click

from config.file_io import save_file
from drivers.clock import SystemClock
from missions.cli.keys import interruptible
from missions.cli.root import FAILURE, INTERRUPTED, SUCCESS
from missions.plugins.testing.worker_pool import PROCESS_ENDED, core_count, run_parallel
from tests.storm.play import Outcome, play_seed
from tests.storm.report import report, schedule
from tests.storm.shrink import as_test, shrunk
from tests.storm.weather import draw


@click.command(epilog="Example: python -m tests.storm --seeds 1000 --jobs 2")
@click.option("--seeds", type=click.IntRange(min=1), default=100, show_default=True, help="Number of seeds.")
@click.option("--first", type=click.IntRange(min=0), default=1, show_default=True, help="First seed.")
@click.option(
    "-j", "--jobs", type=click.IntRange(min=1), metavar="N", help="Worker processes; one per core by default."
)
@click.option("--seed", type=click.IntRange(min=0), metavar="SEED", help="Play this seed alone and print its schedule.")
@click.option("--shrink", is_flag=True, help="With --seed: find the fewest faults that still break it; write a test.")
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="With --shrink: the test's file; test_storm_SEED.py by default.",
)
def command(seeds: int, first: int, jobs: int | None, seed: int | None, shrink: bool, output: Path | None) -> int:
    """Play random missions on random simulated robots under random faults, and report each broken promise.

    A seed stands for all of it: the same seed gives the same events, to the byte, on every machine. The promises
    are listed in docs/reliability.md.

    Exit code: 0 if all promises held, 1 if one broke, 130 if interrupted, after a report of the seeds played so far.
    """
    if shrink and seed is None:
        raise click.UsageError("--shrink is for one seed: add --seed SEED")
    if output is not None and not shrink:
        raise click.UsageError("--output names the file of a test: add --shrink")
    if seed is not None:
        return play_one(seed, output or Path(f"test_storm_{seed}.py"), shrink=shrink)
    clock = SystemClock()
    outcomes, interrupted = list[Outcome](), False
    try:
        with interruptible():
            for outcome in play_all(range(first, first + seeds), jobs or core_count()):
                outcomes.append(outcome)
                if outcome.broken:
                    click.echo(f"seed {outcome.weather.seed} breaks {', '.join(outcome.broken)}", err=True)
    except KeyboardInterrupt:
        interrupted = True
    outcomes.sort(key=lambda it: it.weather.seed)
    click.echo(report(outcomes, clock.now()))
    if interrupted:
        return INTERRUPTED
    return FAILURE if any(each.broken for each in outcomes) else SUCCESS


def play_all(seeds: range, jobs: int) -> Iterator[Outcome]:
    """Yield the outcome of each seed. With one job a run takes Ctrl-C for its own, and the next seed follows."""
    if jobs == 1:
        yield from map(play_seed, seeds)
        return
    with closing(run_parallel(play_seed, seeds, _gone, jobs=jobs)) as outcomes:
        yield from outcomes


def _gone(seed: int) -> Outcome:
    return Outcome(draw(seed), broken={"raises": PROCESS_ENDED})


def play_one(seed: int, output: Path, *, shrink: bool) -> int:
    """Play one seed, print its schedule, and shrink it."""
    outcome = play_seed(seed)
    click.echo(schedule(outcome))
    if not outcome.broken:
        return SUCCESS
    if shrink:
        outcome = shrunk(
            outcome, lambda found: click.echo(f"still broken with {len(found.weather.faults)} faults", err=True)
        )
        save_file(output, as_test(outcome))
        click.echo(f"{schedule(outcome)}\nwrote {output}")
    return FAILURE


if __name__ == "__main__":
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell starts jobs in the background so
        signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(command.main(standalone_mode=False))
