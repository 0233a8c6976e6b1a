"""One run of a mission from a command: shown while it goes on, and what it leaves behind written."""

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
"""Seconds in which a run that hangs for good may say how it ended: a view needs half a second to leave."""


def run(
    request: RunRequest,
    out: TextIO,
    report_result: Callable[[Result], None],
    *,
    leash: int | None = None,
    contexts: Sequence[RunContext] = (),
    reachable: bool = False,
) -> Result:
    """Run ``order``, show on ``out`` what happens, and write what it leaves behind.

    ``last_words`` are said where a run that hangs for good ends the process. ``leash`` is the end of the pipe of a
    server that has started it. ``contexts`` take part in the run: records, films, views. `mission stop` and the
    studio reach each run but a batch, and that too if it is to be ``reachable``.
    """
    with ExitStack() as loading:
        reachable = reachable or leash is not None or not request.is_batch
        if reachable:
            from missions.control.holders import announce_command, require_not_stopped  # noqa: PLC0415 - a batch needs none of it

            with suppress(OSError):  # without any folder, its control socket tells what that means
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
    """Read and check everything, and open nothing."""

    def give_up(result: Result) -> None:
        def say() -> None:
            session.display.__exit__(None, None, None)
            report_result(result)

        # What hangs may hang on stdout: nothing here waits for that for ever.
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
    """Run what was checked. A stop before its control socket is there ends the process, until ``loading`` is over."""
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
        elif leash is None:  # which tells that the server has gone
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
    """Enter a context of a plug-in, which cannot keep back what ends the run."""
    context.__enter__()

    def leave(kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        context.__exit__(kind, error, trace)

    closing.push(leave)


def _make_control_socket(runner: Runner) -> "ControlSocket":
    from missions.control.control import ControlSocket  # noqa: PLC0415 - as in ``run``

    return ControlSocket(runner)


def _print_outputs(files: Sequence[Path], failed_listeners: Iterable[object]) -> None:
    """Say what a run has left behind, and which events were not told; where nobody reads it, to nobody."""
    with suppress(OSError):
        if files:
            from missions.cli.outputs import written_message  # noqa: PLC0415 - many runs write nothing

            click.echo(written_message(*map(str, files)), err=True)
    for each in failed_listeners:
        with suppress(OSError):
            click.echo(f"mission: not all events were told: {each}", err=True)


def warn_unreachable(control: "ControlSocket") -> None:
    """Say that no stop can reach a run. Raises NoStop where it would move a robot, unless the user allows that."""
    control.require_stop("mission run --without-stop")
    if control.trouble:
        click.echo(f"mission: {control.trouble}: `mission stop` cannot reach this run", err=True)


def _end_overdue(runner: Runner, time: float) -> None:
    """End a run that has not ended by itself, and say what it was at."""
    at = [
        f"{node.name} (line {node.line})"
        for node in runner.root.iterate()
        if isinstance(node, Leaf) and node.status is Status.RUNNING
    ]
    runner.executive.stop(f"still running after {quantity_text(time, 'duration')} of simulated time: {', '.join(at)}")
