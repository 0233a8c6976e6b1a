"""Whether what a user asks of a run makes sense, before anything is opened or written."""

from pathlib import Path

import click

from missions.cli.movie import check_place
from missions.language.plan import Plan
from missions.order import RunRequest, contradictions


def check_order(order: RunRequest) -> None:
    """Raise click.UsageError for options that contradict each other, or could only be ignored."""
    for why in contradictions(order, _option):
        raise click.UsageError(why)


def _option(name: str, value: str = "") -> str:
    """Return how an option is typed."""
    return f"--{name} {value}".rstrip()


def check_pad(order: RunRequest, plan: Plan) -> None:
    """Raise click.UsageError for a pad that would have nothing to drive."""
    if order.pad is not None and "base" not in plan.tree.parts:
        raise click.UsageError(f"--pad drives the base, which {plan.mission} does not use")


def check_events(path: Path, plan: Plan) -> None:
    """Raise click.UsageError for an events file that would take the place of a file that the run reads."""
    for step in plan.tree.walk():
        if Path(step.source.name).exists() and path.exists() and path.samefile(step.source.name):
            raise click.UsageError(f"--events would write over the mission {path}")


def check_film(path: Path, order: RunRequest) -> None:
    """Raise click.UsageError for a film that cannot be made, or would take the place of something."""
    if order.simulation != "fast":
        raise click.UsageError("--film is made in simulated time: add --simulate fast")
    check_place(path, "--film")
