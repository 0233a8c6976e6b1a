"""Waiting for a person at a terminal: until Enter is pressed, or for so many seconds where that was asked.

Before torque goes off or gets less, the person is asked to hold the arm: ``confirm_limp``, ``confirm_weak``.
"""

import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager

import click

from drivers.clock import Clock
from missions.cli.keys import Keys
from missions.cli.printable import show_over
from missions.plugins.setup.servo.bench import PAUSE, pause


def require_terminal(seconds: float | None) -> None:
    """Raise click.UsageError where nobody could press Enter, and no time was given."""
    if seconds is None and not sys.stdin.isatty():
        raise click.UsageError("the Enter key needs a terminal; say how long with --seconds N")


hold_option = click.option(
    "--yes", is_flag=True, help="Somebody holds the arm already: do not wait for Enter before the torque goes off."
)
"""Adds ``--yes`` to a command that switches torque off."""


def confirm_limp(names: Collection[str], *, stiff: bool, simulated: bool, yes: bool) -> None:
    """Say which joints go limp, and wait until the person at the terminal holds the arm and presses Enter.

    ``stiff`` says whether any of them has torque, or may have. Without a terminal nobody can answer: then joints go
    limp that are limp already, are ``simulated``, or with ``yes``. Raises click.UsageError otherwise, and click.Abort
    where the input ends.
    """
    if yes or simulated or not names:
        return
    _confirm_held(f"the torque of {', '.join(names)} goes off: hold the arm, it falls", stiff=stiff)


def confirm_weak(names: Collection[str], *, simulated: bool, yes: bool) -> None:
    """As ``confirm_limp``, for stiff joints that are about to hold with less force."""
    if yes or simulated or not names:
        return
    _confirm_held(f"{', '.join(names)} will hold with less force: hold the arm, it may fall", stiff=True)


def _confirm_held(told: str, *, stiff: bool) -> None:
    """Wait for Enter of a person who holds the arm. Raises click.UsageError without a terminal, and click.Abort."""
    if not sys.stdin.isatty():
        if stiff:
            raise click.UsageError(f"{told}; at a terminal Enter confirms that, without one --yes")
        return
    click.echo(f"{told}\nEnter when you hold it; Ctrl-C changes nothing", err=True)
    with Keys(sys.stdin.fileno()) as keys:
        while (key := keys.read(PAUSE)) != "enter":
            if key == "end":
                raise click.Abort


@contextmanager
def patience(
    clock: Clock, seconds: float | None, wait: Callable[[], object] | None = None
) -> Iterator[Callable[[], bool]]:
    """Give out a question that waits a moment, then says whether it is over: Enter was pressed, or the time is up.

    It waits for what ``wait`` waits for, if that is given.
    """
    if seconds is not None:
        end = clock.now() + seconds

        def timed() -> bool:
            (wait or pause)()
            return clock.now() >= end

        yield timed
        return
    with Keys(sys.stdin.fileno()) as keys:

        def pressed() -> bool:
            if wait is not None:
                wait()
            return keys.read(PAUSE if wait is None else 0.0) in ("enter", "end")

        yield pressed


def show(line: str) -> None:
    """Show a line in the place of the one before, where there is a terminal."""
    if sys.stderr.isatty():
        show_over(line, err=True)
