"""Commands that hold a robot and are no runs: known to `mission stop`, which ends them by a signal."""

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress

import click

from drivers.errors import DriverError
from missions.control import abstract_sockets
from missions.control.notes import RunNotes, was_stopped_since
from missions.control.processes import identity_of

WITHOUT_STOP = "MISSION_WITHOUT_STOP"
"""Environment variable: `yes` lets a robot move even if `mission stop` cannot reach the process that moves it."""


OWN_PROCESS = "alone"
"""Object of the root context of a command whose process does nothing else."""


class NoStop(DriverError):
    """What would move a robot cannot be stopped from elsewhere, and nobody has said that this may be."""


class StoppedWhileLoading(DriverError):
    """`mission stop` was typed after this command, which was not found then, since it was still loading."""


def require_not_stopped() -> None:
    """Raise StoppedWhileLoading if all was stopped since this process began. Call this after its note is written.

    Does nothing where the process is not the command's alone: a stop from before the call means others then.
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
    """Have a command known while this is entered: by notes, and by an abstract socket. Raises OSError without either.

    ``simulated`` is how its robot is simulated, empty for one that moves.
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
    """Have a command known by a file in memory while this is entered, if the kernel has those: one way of several."""
    with ExitStack() as closing:
        with suppress(OSError):
            name = abstract_sockets.make_name(str(os.getpid()), "command", simulated=simulated)
            closing.callback(os.close, abstract_sockets.hold_name(name))
        yield


@contextmanager
def hold_robot(robot: str, *, simulated: bool) -> Iterator[None]:
    """Let ``mission stop`` end the command that is being done, by a SIGTERM, while it holds a robot.

    Enter it where that signal ends the command, and open the robot within: it is closed before the stop is told.
    Raises NoStop where a robot would move that no stop reaches.
    """
    name = _command_name()
    by: list[str] = []
    with ExitStack() as keeping:
        keeping.callback(_print_stop, name, robot, by)
        try:
            notes = keeping.enter_context(announce_command(name, robot, "wire" if simulated else ""))
        except OSError as error:  # such as a full disk: its terminal, and signals, stop it
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
    """Raise NoStop if a robot would move that no stop reaches, unless the user allows that: with `yes` alone.

    ``allowed`` is what to type for that.
    """
    value = os.environ.get(WITHOUT_STOP, "").strip()
    if not simulated and value.lower() not in ("", "no", "yes"):
        raise NoStop(f"{trouble}; {WITHOUT_STOP}={value} is neither yes nor no", hint=f"{WITHOUT_STOP}=yes, or =no")
    if not simulated and value.lower() != "yes":
        what = f"{trouble}: `mission stop` could not stop this, so no robot is moved"
        hint = f"XDG_STATE_HOME=FOLDER that can be written; or, with a hand at the robot's own switch: {override}"
        raise NoStop(what, hint=hint)


def _print_stop(name: str, robot: str, by: Sequence[str]) -> None:
    """Say who stopped a command, if somebody did, once its robot is closed and its note is gone."""
    if by:
        click.echo(f"mission {name}: stopped by {by[0]}; {robot} was brought to rest", err=True)


def _command_name() -> str:
    """Return the command that is being done, such as "head look"."""
    context, words = click.get_current_context(), list[str]()
    while context.parent is not None:
        words.insert(0, context.info_name or "")
        context = context.parent
    return " ".join(words)
