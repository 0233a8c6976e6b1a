"""``mission storm``: missions, robots, worlds and faults by chance, by the thousand; and what holds all the same."""

import json
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import click

from config.saving import save_file
from drivers.clock import SystemClock
from missions.cli.keys import interruptible
from missions.cli.numbers import Whole
from missions.cli.outputs import writing
from missions.cli.root import FAILURE, INTERRUPTED, SUCCESS
from missions.testing.many import GONE, cores, do_all
from tests.storm.play import Outcome, play_seed
from tests.storm.report import as_data, report, schedule
from tests.storm.shrink import as_test, shrunk
from tests.storm.weather import draw


@click.command(epilog="Example: mission storm --seeds 1000 --jobs 2")
@click.option("--seeds", type=Whole(min=1), default=100, show_default=True, help="How many.")
@click.option("--first", type=Whole(min=0), default=1, show_default=True, help="The first of them.")
@click.option("-j", "--jobs", type=Whole(min=1), metavar="N", help="As many processes; one for each core.")
@click.option(
    "--seed", type=Whole(min=0), metavar="SEED", help="Play this one alone, and tell all that goes wrong in it."
)
@click.option("--shrink", is_flag=True, help="With --seed: find the fewest faults that still break it; write a test.")
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="With --shrink: where the test goes; test_storm_SEED.py when not given.",
)
@click.option("--json", "as_json", is_flag=True, help="Write what came of it as JSON, for other programs.")
def command(
    seeds: int, first: int, jobs: int | None, seed: int | None, shrink: bool, output: Path | None, as_json: bool
) -> int:
    """Play random missions on random simulated robots while random things go wrong, and say which promise broke.

    A seed stands for all of it: the same one gives the same events, to the byte, on every machine. Whatever happens,
    the base must come to rest, nothing may move that no behaviour claims, limits are kept, every failure has a reason,
    and what was recorded is decided again as it was: docs/reliability.md has them all.

    Exit code 0 is that all held, 1 that something broke, 130 that it was interrupted; then what was played so far is
    told.
    """
    if shrink and seed is None:
        raise click.UsageError("--shrink is for one seed: add --seed SEED")
    if output is not None and not shrink:
        raise click.UsageError("--output is where a test is written: add --shrink")
    if seed is not None:
        return _one(seed, output or Path(f"test_storm_{seed}.py"), shrink=shrink, as_json=as_json)
    clock = SystemClock()
    outcomes, interrupted = list[Outcome](), False
    try:
        with interruptible():  # one that was started in the background does not hear Ctrl-C
            for outcome in _played(range(first, first + seeds), jobs or cores()):
                outcomes.append(outcome)
                if outcome.broken:
                    click.echo(f"seed {outcome.weather.seed} breaks {', '.join(outcome.broken)}", err=True)
    except KeyboardInterrupt:
        interrupted = True
    outcomes.sort(key=lambda it: it.weather.seed)
    wall = clock.now()
    click.echo(json.dumps(as_data(outcomes, wall), indent=2) if as_json else report(outcomes, wall))
    if interrupted:
        return INTERRUPTED
    return FAILURE if any(each.broken for each in outcomes) else SUCCESS


def _played(seeds: range, jobs: int) -> Iterator[Outcome]:
    """Yield what comes of each seed. With one job a run takes Ctrl-C for its own, and the next seed follows."""
    if jobs == 1:
        yield from map(play_seed, seeds)
        return
    with closing(do_all(play_seed, seeds, _gone, jobs=jobs)) as outcomes:
        yield from outcomes


def _gone(seed: int) -> Outcome:
    return Outcome(draw(seed), broken={"raises": GONE})


def _one(seed: int, output: Path, *, shrink: bool, as_json: bool) -> int:
    """Play one seed, tell what it stands for, and make it smaller."""
    outcome = play_seed(seed)
    click.echo(json.dumps(as_data([outcome], outcome.wall), indent=2) if as_json else schedule(outcome))
    if not outcome.broken:
        return SUCCESS
    if shrink:
        outcome = shrunk(
            outcome, lambda found: click.echo(f"still broken with {len(found.weather.faults)} faults", err=True)
        )
        with writing(output, "--output"):
            save_file(output, as_test(outcome))
        click.echo(f"{schedule(outcome)}\nwrote {output}", err=as_json)
    return FAILURE
