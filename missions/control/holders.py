"""Commands that move a robot but are not runs, such as teleop: `mission stop` finds them and ends them by a signal."""

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress

import click

from drivers.errors import DriverError
from missions.control import abstract_sockets
from missions.control.notes import RunNotes, was_stopped_since
from missions.control.processes import identity_of

WITHOUT_STOP = "MISSION_WITHOUT_STOP"
"""Environment variable: `yes` lets a robot move even if `mission stop` cannot reach its process."""


OWN_PROCESS = "alone"
"""Value of ``obj`` in click's root context if the process runs only this command; as in `missions.cli.commands`."""


class NoStop(DriverError):
    """A robot would move although `mission stop` cannot reach this process, and the user did not allow that."""


class StoppedWhileLoading(DriverError):
    """A stop came while this command was still loading, so that `mission stop` could not find it yet."""


def require_not_stopped() -> None:
    """Raise StoppedWhileLoading if `mission stop` was used after this process started.

    Call it after ``announce_command`` has made the command visible to `mission stop`. Does nothing if the process runs
    more than one command, since the stop was then for an earlier one.
    """
    context = click.get_current_context(silent=True)
    process = identity_of(os.getpid())
    if context is None or context.find_root().obj != OWN_PROCESS or process is None:
        return
    if was_stopped_since(process):
        raise StoppedWhileLoading(
            "`mission stop` was typed while this was loading, so nothing moves", hint="start it again"
        )


@contextmanager
def announce_command(name: str, robot: str, simulated: str = "") -> Iterator[RunNotes]:
    """Make the command ``name`` visible to `mission stop`, by note files and an abstract socket, within the context.

    ``simulated`` is "wire", "fast", or empty for a real robot. Raises OSError if both ways fail.
    """
    run = str(os.getpid())
    notes = RunNotes(run, name, robot, simulated, is_run=False)
    with ExitStack() as closing:
        closing.callback(notes.close)
        errors = list[OSError]()
        closing.enter_context(_hold_process_name(simulated=bool(simulated)))
        try:
            known = abstract_sockets.make_name(run, "command", simulated=bool(simulated))
            closing.callback(abstract_sockets.bind_marker(known).close)
        except OSError as error:
            errors.append(error)
        try:
            notes.write()
        except OSError as error:
            if errors:
                raise
            errors.append(error)
        yield notes


@contextmanager
def _hold_process_name(*, simulated: bool) -> Iterator[None]:
    """Make this process visible to `mission stop` by the name of a memory file (memfd), if the kernel supports that."""
    with ExitStack() as closing:
        with suppress(OSError):
            name = abstract_sockets.make_name(str(os.getpid()), "command", simulated=simulated)
            closing.callback(os.close, abstract_sockets.hold_name(name))
        yield


@contextmanager
def hold_robot(robot: str, *, simulated: bool) -> Iterator[None]:
    """Let `mission stop` end the present command by SIGTERM while it moves a robot.

    Open the robot inside this context, and convert SIGTERM to an exception before you enter it. Then the exception
    closes the robot first, and the context prints the message about the stop afterwards. Raises NoStop if a real robot
    would move that no stop can reach.
    """
    name = _command_name()
    by: list[str] = []
    with ExitStack() as keeping:
        keeping.callback(_print_stop, name, robot, by)
        try:
            notes = keeping.enter_context(announce_command(name, robot, "wire" if simulated else ""))
        except OSError as error:  # such as a full disk: Ctrl-C and signals still stop it
            require_stop(f"{error}", simulated=simulated)
            require_not_stopped()
            click.echo(f"mission: {error}: `mission stop` cannot reach this command", err=True)
            with _hold_process_name(simulated=simulated):
                yield
            return
        require_not_stopped()
        try:
            yield
        finally:
            by += notes.stop_requesters()


def require_stop(trouble: str, *, simulated: bool, override: str = f"{WITHOUT_STOP}=yes") -> None:
    """Raise NoStop for a real robot, unless the environment variable MISSION_WITHOUT_STOP is `yes`.

    ``trouble`` is the reason why no stop can reach the process. ``override`` is an option that allows it, for the hint.
    """
    value = os.environ.get(WITHOUT_STOP, "").strip()
    if not simulated and value.lower() not in ("", "no", "yes"):
        raise NoStop(f"{trouble}; {WITHOUT_STOP}={value} is neither yes nor no", hint=f"{WITHOUT_STOP}=yes, or =no")
    if not simulated and value.lower() != "yes":
        what = f"{trouble}: `mission stop` could not stop this, so no robot is moved"
        hint = f"set XDG_STATE_HOME to a writable folder; or, with a hand on the robot's own switch: {override}"
        raise NoStop(what, hint=hint)


def _print_stop(name: str, robot: str, by: Sequence[str]) -> None:
    """Print that the command ``name`` was stopped, and by whom; nothing if ``by`` is empty.

    Called once the robot is closed and the command no longer visible to `mission stop`.
    """
    if by:
        click.echo(f"mission {name}: stopped by {by[0]}; {robot} was brought to rest", err=True)


def _command_name() -> str:
    """Return the name of the present command, such as "head look"."""
    context, words = click.get_current_context(), list[str]()
    while context.parent is not None:
        words.insert(0, context.info_name or "")
        context = context.parent
    return " ".join(words)
