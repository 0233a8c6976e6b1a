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
from config.library import DEFAULT_ROBOT
from config.reading import files_read
from config.units import written
from missions.cli.commands import settle
from missions.cli.leash import GONE, heeded, heeded_each_tick, leashed
from missions.cli.live import Watcher
from missions.cli.options import tell_found
from missions.cli.orders import check_order, check_people
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

LAST_WORDS_TIME = 3.0
"""Seconds in which a run that hangs for good may say how it ended: a view needs half a second to leave."""


def run(
    order: RunRequest,
    out: TextIO,
    last_words: Callable[[Result], None],
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
        reachable = reachable or leash is not None or not order.is_batch
        if reachable:
            from missions.control.holders import noted, require_not_stopped  # noqa: PLC0415 - a batch needs none of it

            with suppress(OSError):  # without any folder, its control socket tells what that means
                loading.enter_context(noted(order.mission, order.robot or DEFAULT_ROBOT, order.simulation or ""))
            require_not_stopped()
        check_order(order)
        session = _session(order, out, last_words)
        result = _run(session, leash, contexts, loading, reachable=reachable)
    if result.reason != GONE:
        _tell_left([path for output in session.outputs if (path := output())], session.runner.stream.lost)
    return result


def _session(order: RunRequest, out: TextIO, last_words: Callable[[Result], None]) -> RunSession:
    """Read and check everything, and open nothing."""

    def give_up(result: Result) -> None:
        def say() -> None:
            session.display.__exit__(None, None, None)
            last_words(result)

        # What hangs may hang on stdout: nothing here waits for that for ever.
        attempt_all({"last words": say}, LAST_WORDS_TIME)
        end_process(result)

    tell_found(behaviour_files(order.mission, order.behaviours), order.behaviours)
    watcher = Watcher(out)
    with files_read() as files:
        runner = Runner(order, listeners=[watcher], give_up=give_up)
    check_people(order, runner.plan)
    watcher.watch(runner.root)
    session = RunSession(order, runner, watcher, out, files)
    return session


def _run(
    session: RunSession, leash: int | None, contexts: Iterable[RunContext], loading: ExitStack, *, reachable: bool
) -> Result:
    """Run what was checked. A stop before its control socket is there ends the process, until ``loading`` is over."""
    runner, until = session.runner, session.request.until
    if until is not None and runner.twins is not None:
        runner.twins.timeline.at(until, partial(_end, runner, until))
    with ExitStack() as closing:
        for context in contexts:
            _enter(context(session), closing)
        control = _control(runner) if reachable else None
        reading: AbstractContextManager[None] = nullcontext()
        read = [sys.stdout, session.out, *session.watched]
        if not reachable:
            session.listen(heeded_each_tick(read, runner.executive.stop))
        elif leash is None:  # which tells that the server has gone
            reading = heeded(read, runner.executive.stop)
        with reading, session.display, leashed(leash, runner.executive, runner.stream), control or nullcontext():
            if control is not None:
                tell_unreachable(control)
            loading.close()
            settle()
            return runner.run()


def _enter(context: AbstractContextManager[object], closing: ExitStack) -> None:
    """Enter a context of a plug-in, which cannot keep back what ends the run."""
    context.__enter__()

    def leave(kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        context.__exit__(kind, error, trace)

    closing.push(leave)


def _control(runner: Runner) -> "ControlSocket":
    from missions.control.control import ControlSocket  # noqa: PLC0415 - as in ``run``

    return ControlSocket(runner)


def _tell_left(files: Sequence[Path], lost: Iterable[object]) -> None:
    """Say what a run has left behind, and which events were not told; where nobody reads it, to nobody."""
    with suppress(OSError):
        if files:
            from missions.cli.outputs import wrote  # noqa: PLC0415 - many runs write nothing

            click.echo(wrote(*map(str, files)), err=True)
    for each in lost:
        with suppress(OSError):
            click.echo(f"mission: not all events were told: {each}", err=True)


def tell_unreachable(control: "ControlSocket") -> None:
    """Say that no stop can reach a run. Raises NoStop where it would move a robot, unless the user allows that."""
    control.require_stop("mission run --without-stop")
    if control.trouble:
        click.echo(f"mission: {control.trouble}: `mission stop` cannot reach this run", err=True)


def _end(runner: Runner, time: float) -> None:
    """End a run that has not ended by itself, and say what it was at."""
    at = [
        f"{node.name} (line {node.line})"
        for node in runner.root.iterate()
        if isinstance(node, Leaf) and node.status is Status.RUNNING
    ]
    runner.executive.stop(f"still running after {written(time, 'duration')} of simulated time: {', '.join(at)}")
