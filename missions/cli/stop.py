"""``mission stop``: every robot of this machine still, at once, whoever runs it; and released again."""

import os
import sys
from collections.abc import Mapping, Sequence

import click

from missions.cli.names import complete_runs
from missions.cli.root import FAILURE, SUCCESS
from missions.control.command_broadcast import send_to_all

NO_RUNS = "no mission runs"


@click.command(epilog="Example: mission stop --release")
@click.argument("which", metavar="[RUN]...", nargs=-1, shell_complete=complete_runs)
@click.option("--list", "only_list", is_flag=True, help="List the runs, and do nothing.")
@click.option("--release", is_flag=True, help="Release what is stopped; the mission stays paused.")
@click.option("--resume", is_flag=True, help="Let a paused mission go on; with --release, one that was stopped.")
@click.option("--end", is_flag=True, help="Stop, and end the mission: the run is over then.")
def command(which: tuple[str, ...], only_list: bool, release: bool, resume: bool, end: bool) -> int:
    """Stop every run of this user at once, or those named (the number of the process, or the mission).

    Base, head, arm and voice stand still, latched, and the mission is paused, until `mission stop --release`. It works
    over SSH and beside any run, with or without the studio. A run that does not answer is ended by a signal.

    A command that moves a robot by hand (teleop, head, servo record) has no latch: it is ended, with all at rest.
    """
    if end and (release or resume):
        raise click.UsageError("--end ends the run: nothing is released then")
    asked: Sequence[Mapping[str, object]] = [{"do": "stop"}, *([{"do": "halt"}] if end else [])]
    if release or resume:
        asked = [*([{"do": "release"}] if release else []), *([{"do": "resume"}] if resume else [])]
    by = f"mission stop (process {os.getpid()})"
    said = send_to_all([] if only_list else asked, by, which)
    fine = all(good for good, _ in said.values())
    try:
        for key, (_, words) in sorted(said.items(), key=lambda each: each[1][1]):
            click.echo(words, err=isinstance(key, str))
        if not said:
            click.echo(NO_RUNS)
    except BrokenPipeError:  # nobody reads it: the exit code says the same
        sys.stdout = None
    return SUCCESS if fine else FAILURE
