"""One run of a mission from a command: shown while it goes on, and what it leaves behind written."""

import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import click
from py_trees.common import Status

from behaviours.leaf import Leaf
from config.library import DEFAULT_ROBOT
from config.units import written
from drivers.api.quick import dataclass
from missions.cli.commands import settle
from missions.cli.leash import GONE, heeded, heeded_each_tick, leashed
from missions.cli.live import Watcher
from missions.cli.options import tell_found
from missions.cli.orders import check_events, check_film, check_order, check_pad, check_people, pad_of
from missions.control.pictures import Pictures
from missions.executive.executive import Result
from missions.executive.watchdog import attempt_all
from missions.library.shipped import behaviour_files
from missions.plugins.records.run_options import Recording, RecordWish
from missions.request import RunRequest
from missions.runner import Runner, end_process

if TYPE_CHECKING:
    from missions.cli.events_file import EventsFile
    from missions.control.control import ControlSocket
    from missions.plugins.pictures.film import Film
    from missions.plugins.ros2.announcing import Announcer
    from missions.plugins.view.viewing import LiveView

LAST_WORDS_TIME = 3.0
"""Seconds in which a run that hangs for good may say how it ended: a view needs half a second to leave."""


@dataclass(frozen=True, slots=True)
class Outputs:
    """What comes of a run, as far as it was asked for: its events as lines, a film, a record, a live ``view``.

    ``leash`` is the end of the pipe of a server that has started it. With ``studio`` the page of the studio shows it.
    ``announcer`` tells ROS 2 of it.
    """

    events: Path | None = None
    film: Path | None = None
    record: RecordWish | None = None
    view: bool = False
    leash: int | None = None
    studio: bool = False
    announcer: "Announcer | None" = None


def run(
    order: RunRequest,
    outputs: Outputs,
    out: TextIO,
    last_words: Callable[[Result], None],
) -> Result:
    """Run ``order``, show on ``out`` what happens, and write what it leaves behind.

    ``last_words`` are said where a run that hangs for good ends the process.
    """
    with ExitStack() as loading:
        if not _is_reachable(order, outputs):
            return _run(order, outputs, out, last_words, loading)
        from missions.control.holders import noted, require_not_stopped  # noqa: PLC0415 - a batch run needs none of it

        with suppress(OSError):  # without any folder, its control socket tells what that means
            loading.enter_context(noted(order.mission, order.robot or DEFAULT_ROBOT, order.simulation or ""))
        require_not_stopped()
        return _run(order, outputs, out, last_words, loading)


def _is_reachable(order: RunRequest, outputs: Outputs) -> bool:
    """Return True if `mission stop` and the studio are to know the run."""
    return not order.is_batch or outputs.studio or outputs.leash is not None


def _run(
    order: RunRequest,
    outputs: Outputs,
    out: TextIO,
    last_words: Callable[[Result], None],
    loading: ExitStack,
) -> Result:
    """Do what ``run`` does. A stop before its control socket is there ends the process, until ``loading`` is over."""
    _check(order, outputs, out)
    watcher = Watcher(out)
    shown: Watcher | LiveView = watcher

    def give_up(result: Result) -> None:
        def say() -> None:
            shown.__exit__(None, None, None)
            last_words(result)

        # What hangs may hang on stdout: nothing here waits for that for ever.
        attempt_all({"last words": say}, LAST_WORDS_TIME)
        end_process(result)

    tell_found(behaviour_files(order.mission, order.behaviours), order.behaviours)
    pictures = Pictures()
    runner, recording = _made(order, outputs.record, watcher, give_up, pictures)
    check_pad(order, runner.plan)
    check_people(order, runner.plan)
    watcher.watch(runner.root)
    if order.until is not None and runner.twins is not None:
        runner.twins.timeline.at(order.until, partial(_end, runner, order.until))
    with ExitStack() as closing:
        film, events = _write(outputs, runner, closing, out)
        if recording is not None:
            closing.enter_context(recording)
        if outputs.view:
            shown = _view(runner, watcher)
            runner.stream.listeners[0] = shown  # in the watcher's place
        control = _control(runner, pictures) if _is_reachable(order, outputs) else None
        if outputs.announcer is not None:
            runner.stream.listeners.append(outputs.announcer)
            closing.enter_context(outputs.announcer)
        with shown, leashed(outputs.leash, runner.executive, runner.stream), control or nullcontext():
            if control is not None:
                tell_unreachable(control)
            loading.close()
            settle()
            result = runner.run()
    if result.reason != GONE:
        _tell_left(_written(recording, events, film), runner.stream.lost)
    return result


def _control(runner: Runner, pictures: Pictures) -> "ControlSocket":
    from missions.control.control import ControlSocket  # noqa: PLC0415 - as in ``run``

    return ControlSocket(runner, pictures)


def _made(
    order: RunRequest,
    wish: RecordWish | None,
    watcher: Watcher,
    give_up: Callable[[Result], None],
    pictures: Pictures,
) -> tuple[Runner, Recording | None]:
    """Read and check everything, open and write nothing; return the run, and its recording where there is to be one."""
    if wish is not None:
        recording = Recording(wish, order, listeners=[watcher], give_up=give_up, pictures=pictures)
        return recording.runner, recording
    runner = Runner(
        order,
        listeners=[watcher],
        give_up=give_up,
        on_view=pictures.view,
        on_frame=pictures.frame,
        pad=pad_of(order),
    )
    return runner, None


def _tell_left(files: Sequence[str], lost: Iterable[object]) -> None:
    """Say what a run has left behind, and which events were not told; where nobody reads it, to nobody."""
    with suppress(OSError):
        if files:
            from missions.cli.outputs import wrote  # noqa: PLC0415 - many runs write nothing

            click.echo(wrote(*files), err=True)
    for each in lost:
        with suppress(OSError):
            click.echo(f"mission: not all events were told: {each}", err=True)


def _written(recording: Recording | None, events: "EventsFile | None", film: "Film | None") -> list[str]:
    """Return the files that a run has left behind, but a film of which nothing could be written."""
    record = recording.path if recording is not None and recording.begun else None
    filmed = film.path if film is not None and film.written else None
    return [str(path) for path in (record, events and events.path, filmed) if path is not None]


def _check(order: RunRequest, outputs: Outputs, out: TextIO) -> None:
    """Raise click.UsageError for what could only be ignored, or cannot be shown or written."""
    check_order(order)
    if outputs.film is not None:
        check_film(outputs.film, order)
    if outputs.view:
        from missions.plugins.view.terminal import unviewable  # noqa: PLC0415 - as `_view`

        if why := unviewable(out):
            raise click.UsageError(why)


def tell_unreachable(control: "ControlSocket") -> None:
    """Say that no stop can reach a run. Raises NoStop where it would move a robot, unless the user allows that."""
    control.require_stop("mission run --without-stop")
    if control.trouble:
        click.echo(f"mission: {control.trouble}: `mission stop` cannot reach this run", err=True)


def _view(runner: Runner, watcher: Watcher) -> "LiveView":
    from missions.plugins.view.viewing import LiveView  # noqa: PLC0415 - a run that nobody views needs none of it

    return LiveView(runner, watcher)


def _end(runner: Runner, time: float) -> None:
    """End a run that has not ended by itself, and say what it was at."""
    at = [
        f"{node.name} (line {node.line})"
        for node in runner.root.iterate()
        if isinstance(node, Leaf) and node.status is Status.RUNNING
    ]
    runner.executive.stop(f"still running after {written(time, 'duration')} of simulated time: {', '.join(at)}")


def _write(
    outputs: Outputs, runner: Runner, closing: ExitStack, out: TextIO
) -> tuple["Film | None", "EventsFile | None"]:
    """Have events and a film written until ``closing`` ends, and the run ended where nobody reads any more.

    Return the film and the file of events, where there is to be one.
    """
    film, events = None, None
    read = [sys.stdout, out]
    if outputs.events is not None:
        from missions.cli.events_file import EventsFile  # noqa: PLC0415 - most runs write no events

        check_events(outputs.events, runner.plan)
        events = closing.enter_context(EventsFile(outputs.events))
        runner.stream.listeners.append(events.lines)
        read.append(events.file)
    if outputs.film is not None and runner.twins is not None:
        from missions.plugins.pictures.film import Film  # noqa: PLC0415 - the metal imports no simulation

        film = Film(outputs.film, runner.twins)
        closing.callback(_tell_trouble, film)
        closing.enter_context(film)
    if not _is_reachable(runner.order, outputs):
        runner.stream.listeners.append(heeded_each_tick(read, runner.executive.stop))
    elif outputs.leash is None:  # which tells that the server has gone
        closing.enter_context(heeded(read, runner.executive.stop))
    return film, events


def _tell_trouble(film: "Film") -> None:
    """Say what became of a film that could not be written to its end; the run's result is another thing."""
    if film.trouble:
        with suppress(OSError):
            click.echo(f"mission: {film.trouble}", err=True)
