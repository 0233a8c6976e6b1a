"""Execution of one run for a command: checks, display, contexts of plug-ins, output files."""

import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext, suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

import click
from py_trees.common import Status

from behaviours.leaf import Leaf
from config.file_io import collect_read_files
from config.library import DEFAULT_ROBOT
from config.units import quantity_text
from missions.cli.commands import freeze_garbage_collector
from missions.cli.leash import OUTPUT_CLOSED, stop_with_server, watch_outputs, watch_outputs_each_tick
from missions.cli.live import RunDisplay
from missions.cli.options import print_found_files
from missions.cli.request_checks import check_people, check_request
from missions.cli.root import DEVICE, FAILURE, INTERRUPTED, SUCCESS
from missions.cli.session import RunContext, RunSession
from missions.executive.executive import Result
from missions.executive.watchdog import attempt_all
from missions.library.shipped import behaviour_files
from missions.request import RunRequest
from missions.runner import Runner, end_process

if TYPE_CHECKING:
    from missions.control.control import ControlSocket

EXIT_CODES = {"success": SUCCESS, "failure": FAILURE, "interrupted": INTERRUPTED, "error": DEVICE}

FINAL_REPORT_TIMEOUT = 3.0
"""Seconds within which the result of a hanging run must be printed, before its process is ended."""


def run(
    request: RunRequest,
    out: TextIO,
    report_result: Callable[[Result], None],
    *,
    leash: int | None = None,
    contexts: Sequence[RunContext] = (),
    reachable: bool = False,
) -> Result:
    """Execute ``request``, show it on ``out``, print the names of the output files, and return the result.

    ``report_result`` is called if the process must end because a leaf hangs. ``leash`` is the file descriptor of a
    pipe: the run stops when the server that started it closes the pipe. ``contexts`` of plug-ins are entered for the
    run: records, films, views. The run gets a control socket unless it is a batch run; with ``reachable``, always.
    """
    with ExitStack() as loading:
        reachable = reachable or leash is not None or not request.is_batch
        if reachable:
            from missions.control.holders import announce_command, require_not_stopped  # noqa: PLC0415 - a batch needs none of it

            with suppress(OSError):  # if there is no folder, the control socket explains it
                loading.enter_context(
                    announce_command(request.mission, request.robot or DEFAULT_ROBOT, request.simulation or "")
                )
            require_not_stopped()
        check_request(request)
        session = _session(request, out, report_result)
        result = _run_session(session, leash, contexts, loading, reachable=reachable)
    if result.reason != OUTPUT_CLOSED:
        _print_outputs(
            [path for output in session.outputs if (path := output())], session.runner.stream.failed_listeners
        )
    return result


def _session(request: RunRequest, out: TextIO, report_result: Callable[[Result], None]) -> RunSession:
    """Return the session of a request, after reading and checking all its files; no device is opened."""

    def give_up(result: Result) -> None:
        def say() -> None:
            session.display.__exit__(None, None, None)
            report_result(result)

        # The pipe of stdout may be blocked: nothing here waits for it without a timeout.
        attempt_all({"last words": say}, FINAL_REPORT_TIMEOUT)
        end_process(result)

    print_found_files(behaviour_files(request.mission, request.behaviours), request.behaviours)
    watcher = RunDisplay(out)
    with collect_read_files() as files:
        runner = Runner(request, listeners=[watcher], give_up=give_up)
    check_people(request, runner.plan)
    watcher.show_tree(runner.root)
    session = RunSession(request, runner, watcher, out, files)
    return session


def _run_session(
    session: RunSession, leash: int | None, contexts: Iterable[RunContext], loading: ExitStack, *, reachable: bool
) -> Result:
    """Run a checked session and return the result.

    ``loading`` is a context in which `mission stop` ends the process by a signal. It is closed once the run's control
    socket accepts stops.
    """
    runner, until = session.runner, session.request.until
    if until is not None and runner.twins is not None:
        runner.twins.timeline.call_at(until, partial(_end_overdue, runner, until))
    with ExitStack() as closing:
        for context in contexts:
            _enter(context(session), closing)
        control = _make_control_socket(runner) if reachable else None
        reading: AbstractContextManager[None] = nullcontext()
        read = [sys.stdout, session.out, *session.watched_outputs]
        if not reachable:
            session.listen(watch_outputs_each_tick(read, runner.executive.stop))
        elif leash is None:  # a leash reports that the server has ended
            reading = watch_outputs(read, runner.executive.stop)
        with (
            reading,
            session.display,
            stop_with_server(leash, runner.executive, runner.stream),
            control or nullcontext(),
        ):
            if control is not None:
                warn_unreachable(control)
            loading.close()
            freeze_garbage_collector()
            return runner.run()


def _enter(context: AbstractContextManager[object], closing: ExitStack) -> None:
    """Enter the context of a plug-in; its exit cannot suppress exceptions of the run."""
    context.__enter__()

    def leave(kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        context.__exit__(kind, error, trace)

    closing.push(leave)


def _make_control_socket(runner: Runner) -> "ControlSocket":
    from missions.control.control import ControlSocket  # noqa: PLC0415 - as in ``run``

    return ControlSocket(runner)


def _print_outputs(files: Sequence[Path], failed_listeners: Iterable[object]) -> None:
    """Print the output files of a run, and listeners that failed; ignore a closed stderr."""
    with suppress(OSError):
        if files:
            from missions.cli.outputs import written_message  # noqa: PLC0415 - many runs write nothing

            click.echo(written_message(*map(str, files)), err=True)
    for each in failed_listeners:
        with suppress(OSError):
            click.echo(f"mission: not all events were delivered: {each}", err=True)


def warn_unreachable(control: "ControlSocket") -> None:
    """Print a warning if `mission stop` cannot reach this run. Raises NoStop if the run would move a real robot.

    With ``--without-stop``, the warning is printed for a real robot too.
    """
    control.require_stop("mission run --without-stop")
    if control.trouble:
        click.echo(f"mission: {control.trouble}: `mission stop` cannot reach this run; stop it with Ctrl-C", err=True)


def _end_overdue(runner: Runner, time: float) -> None:
    """Stop a run at the ``time`` (s) of ``--until``; the reason names the leaves that are still running."""
    at = [
        f"{node.name} (line {node.line})"
        for node in runner.root.iterate()
        if isinstance(node, Leaf) and node.status is Status.RUNNING
    ]
    runner.executive.stop(f"still running after {quantity_text(time, 'duration')} of simulated time: {', '.join(at)}")
