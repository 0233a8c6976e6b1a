"""``mission stop``: stop all runs of this user on this computer, and release them."""

import os
import sys
from collections.abc import Mapping, Sequence

import click

from missions.cli.names import complete_runs
from missions.cli.root import FAILURE, SUCCESS
from missions.control.command_broadcast import send_to_all

NO_RUNS = "no mission is running"


@click.command(epilog="Example: mission stop --release --resume")
@click.argument("which", metavar="[RUN]...", nargs=-1, shell_complete=complete_runs)
@click.option("--list", "only_list", is_flag=True, help="List the runs and their states, without stopping them.")
@click.option("--release", is_flag=True, help="Release a stop; the mission stays paused.")
@click.option("--resume", is_flag=True, help="Resume a paused mission; with --release, also a stopped one.")
@click.option("--end", is_flag=True, help="Stop, and end the run.")
def command(which: tuple[str, ...], only_list: bool, release: bool, resume: bool, end: bool) -> int:
    """Stop all runs of this user on this computer, or the named ones (process number or mission).

    The stop latches: base, head, arm and voice stay stopped, and the mission paused. To go on: `mission stop --release
    --resume`. This works over SSH, with or without the studio. A run that does not reply is ended by a signal.

    Commands that move a robot by hand (teleop, head, servo record) are ended, with all parts at rest.
    """
    if end and (release or resume):
        raise click.UsageError("--end cannot be combined with --release or --resume")
    commands: Sequence[Mapping[str, object]] = [{"do": "stop"}, *([{"do": "halt"}] if end else [])]
    if release or resume:
        commands = [*([{"do": "release"}] if release else []), *([{"do": "resume"}] if resume else [])]
    by = f"mission stop (process {os.getpid()})"
    results = send_to_all([] if only_list else commands, by, which)
    fine = all(good for good, _ in results.values())
    try:
        for key, (_, words) in sorted(results.items(), key=lambda each: each[1][1]):
            click.echo(words, err=isinstance(key, str))
        if not results:
            click.echo(NO_RUNS)
    except BrokenPipeError:  # the exit code has the same result
        sys.stdout = None
    return SUCCESS if fine else FAILURE
