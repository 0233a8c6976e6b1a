"""``mission task``: the queue of missions that ``mission task serve`` runs."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, replace
from datetime import UTC, datetime
from getpass import getuser
from pathlib import Path
from typing import Literal

import click
from click.shell_completion import CompletionItem

from config.library import find_file, shipped_files
from config.notices import public_text
from missions.cli.commands import LazyGroup
from missions.cli.names import MISSION
from missions.cli.numbers import WholeNumber
from missions.cli.option_declarations import DeclaredCommand, add_options, behaviours_option, params_option, run_options
from missions.cli.options import SECONDS
from missions.cli.printable import format_columns
from missions.cli.request_checks import check_request
from missions.cli.root import SUCCESS
from missions.language.plan import Plan
from missions.library.folders import state_folder
from missions.library.shipped import find_mission, shipped_missions
from missions.plugins.tasks.channels import channels_of
from missions.plugins.tasks.file_lock import is_locked, server_lock
from missions.plugins.tasks.outbox import Outbox, QueuedNotice
from missions.plugins.tasks.queue import TaskQueue, first_time, local_zone, read_at, read_repetition, wall_clock
from missions.plugins.tasks.queue_database import open_db, queue_errors, queue_file
from missions.plugins.tasks.task import PRIORITIES, Attempt, Interrupted, NewTask, RetryPolicy, Task, TaskError
from missions.request import RunRequest, Simulate

# Texts of tasks, attempts and notices on a terminal.


def list_row(task: Task) -> Mapping[str, str]:
    """Return the cells of a task in the table of `mission task list`, by column heading."""
    return {
        "task": str(task.id),
        "state": _state(task),
        "priority": str(task.priority),
        "due": clock_text(task.due_since) if task.due else "at once",
        "every": task.every or "-",
        "mission": task.name,
        "params": " ".join(f"{name}={value}" for name, value in task.params.items()) or "-",
        "reason": task.reason,
    }


def _state(task: Task) -> str:
    if task.awaits_approval:
        return "needs approval"
    return "stopping" if task.cancelling and task.state == "running" else task.state.replace("_", " ")


def describe_attempt(attempt: Attempt) -> str:
    """Return the line about an attempt in the output of `mission task log`."""
    if attempt.ended is None:
        return f"{clock_text(attempt.began)}  attempt {attempt.number} begins"
    reason = f": {attempt.reason}" if attempt.reason else ""
    seconds = attempt.ended - attempt.began
    return f"{clock_text(attempt.began)}  attempt {attempt.number}: {attempt.how} after {seconds:.0f} s{reason}"


def describe_notice(queued: QueuedNotice) -> str:
    """Return the line about a notice in the output of `mission task log`."""
    if queued.delivered is not None:
        return f"{clock_text(queued.delivered)}  delivered to {queued.channel}: {queued.notice.text}"
    why = f" ({queued.tries} tries; {queued.last_error})" if queued.tries else ""
    state = "given up, not delivered" if queued.given_up else "not delivered yet"
    return f"{clock_text(queued.added)}  {state} to {queued.channel}{why}: {queued.notice.text}"


def clock_text(time: float) -> str:
    """Return a Unix time as local date and time, or as a number if it is out of the calendar's range."""
    try:
        return f"{datetime.fromtimestamp(time, UTC).astimezone(local_zone()):%Y-%m-%d %H:%M:%S}"
    except (ValueError, OverflowError, OSError):
        return f"{time:g}"


DEFAULT_LATE_LIMIT = 3600.0
"""Default of `--late`: seconds after its time within which a task must begin; after that, it is missed."""

POLICIES: Mapping[str, Interrupted] = {"": "retry", "retry": "retry", "give_up": "give-up"}
"""Interruption policy of a task, by the value of `if_interrupted` in its mission; empty if the mission has none."""


def _numbers(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return shell completions: the numbers of open tasks."""
    del ctx, param
    with suppress(click.ClickException), _queue() as (queue, _):
        tasks = queue.tasks(ended=False)
        return [
            CompletionItem(str(each.id), help=each.mission) for each in tasks if str(each.id).startswith(incomplete)
        ]
    return []


def _user_name() -> str:
    """Return the name of the current user, or the user ID if it has no name."""
    with suppress(KeyError, OSError):
        return getuser()
    return str(os.geteuid())


NUMBER = click.argument("number", metavar="TASK", type=WholeNumber(min=1), shell_complete=_numbers)
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


MAX_CLOCK_ERROR = 60.0
"""Seconds by which a task may have been added in the future of this computer's clock before a warning.

Smaller differences are normal, since setting the clock may move it back.
"""


@click.group(
    "task",
    cls=LazyGroup,
    epilog="Example: mission task list",
)
def command() -> None:
    """Queue missions to run in turn, at a time, or repeatedly; `mission task serve` runs them.

    The queue survives crashes and power cuts.
    """


@contextmanager
def _queue() -> Iterator[tuple[TaskQueue, Outbox]]:
    """Open the user's queue; its errors become click exceptions."""
    try:
        path = queue_file(state_folder())
        with queue_errors(path), closing(open_db(path)) as connection:
            yield TaskQueue(connection, channels_of, local_zone()), Outbox(connection)
    except TaskError as error:
        hint = f"\n  try: {error.hint}" if error.hint else ""
        raise click.ClickException(f"{error}{hint}") from error


@command.command(cls=DeclaredCommand, epilog="Example: mission task add greet --at 18:00 --every day --simulate fast")
@click.argument("mission", type=MISSION)
@params_option
@behaviours_option
@click.option(
    "--at", metavar="TIME", help='Start time: "18:00", the next such time, or "2026-12-24 18:00"; the default is now.'
)
@click.option("--every", metavar="TIME", help='Repetition: "30 min", day, monday, or "day 18:00".')
@click.option(
    "--late", type=SECONDS, metavar="TIME", help="Skip it, with a notice, if it is later than this; the default is 1 h."
)
@click.option(
    "--priority",
    type=WholeNumber(*PRIORITIES),
    default=0,
    metavar="NUMBER",
    help="Priority from -100 to 100, default 0: the highest of the due tasks runs first; running tasks go on.",
)
@click.option("--retry", type=WholeNumber(min=0), default=0, metavar="TIMES", help="Number of retries after a failure.")
@click.option(
    "--if-interrupted",
    "interrupted",
    type=click.Choice(["retry", "give-up"]),
    help="Action if it was interrupted, for example by a power cut; the default is that of the mission, or retry.",
)
@click.option("--needs-approval", is_flag=True, help="Wait for approval: mission task approve.")
@add_options(*run_options("robot", "simulate", "world", "eyes"))
def add(
    mission: str,
    params: dict[str, str],
    files: tuple[Path, ...],
    at: str | None,
    every: str | None,
    late: float | None,
    priority: int,
    retry: int,
    interrupted: Interrupted | None,
    needs_approval: bool,
    robot: str | None,
    simulate: Simulate | None,
    world: str | None,
    eyes: Literal["pixels", "truth"],
) -> int:
    """Add a task to the queue.

    Its mission (a name or a file) is checked now, and run by `mission task serve`.
    """
    order = RunRequest(mission, params, robot, simulate, world, behaviours=files, eyes=eyes)
    plan = _check(order)
    time = wall_clock()
    due, repetition = _when(at, every, time)
    new = NewTask(
        mission=_portable_name(mission, shipped_missions(), find_mission(mission)),
        params=params,
        robot="" if robot is None else _portable_name(robot, shipped_files("robots"), find_file("robots", robot)),
        options=tuple(_options(order)),
        due=due,
        priority=priority,
        late=DEFAULT_LATE_LIMIT if late is None and (at or every) else late,
        every=repetition,
        policy=RetryPolicy(interrupted or POLICIES[plan.if_interrupted], retries=retry),
        needs_approval=needs_approval,
    )
    with _queue() as (queue, _):
        number = queue.add(new, time)
    when = f"at {clock_text(due)}" if due > time else "as soon as its turn comes"
    click.echo(f"task {number}: {new.name} runs {when}" + (f", then every {repetition}" if repetition else ""))
    if needs_approval:
        click.echo(f"it waits for approval: mission task approve {number}")
    if _is_served() is False:
        click.echo("no server is running the tasks: mission task serve", err=True)
    return SUCCESS


def _is_served() -> bool | None:
    """Return whether a task server runs; None, after a warning, if that is unknown."""
    try:
        return is_locked(server_lock(state_folder()))
    except OSError as error:
        click.echo(f"it is not known whether a server runs the tasks: {error}", err=True)
        return None


def _as_json(task: Task) -> dict[str, object]:
    """Return a task for JSON output, without secrets of its channels."""
    return asdict(task) | {"channels": [public_text(each) for each in task.channels]}


def _check(request: RunRequest) -> Plan:
    """Return the checked plan of the mission; raise the errors that `mission run` would raise for this request."""
    from missions.cli.request_checks import check_people  # noqa: PLC0415 - slow imports that other subcommands do not need
    from missions.runner import load_plan, requested_robot  # noqa: PLC0415

    check_request(request)
    if request.simulation is not None:
        request.world_file()
    plan = load_plan(request, requested_robot(request))
    check_people(request, plan)
    return plan


def _when(at: str | None, every: str | None, time: float) -> tuple[float, str]:
    """Return the first due time and the repetition of a task.

    The due time is 0 for a task without one, which runs after the tasks added before it. ``time`` is the present time.
    """
    zone = local_zone()
    try:
        due = 0.0 if at is None else read_at(at, time, zone)
        if every is None:
            return due, ""
        repetition = read_repetition(every, due or time, zone, at or "")
        return (due if repetition.period else first_time(repetition, due or time, zone)), str(repetition)
    except ValueError as error:
        raise click.UsageError(str(error)) from error


def _options(request: RunRequest) -> Iterator[str]:
    """Yield the options of `mission run` that a task stores in ``options``: simulation, world, eyes and behaviours."""
    if request.simulate is not None:
        yield f"--simulate={request.simulate}"
    if isinstance(request.world, str):
        yield f"--world={_portable_name(request.world, shipped_files('worlds'), find_file('worlds', request.world))}"
    if request.eyes != "pixels":
        yield f"--eyes={request.eyes}"
    for file in request.behaviours:
        yield f"--behaviours={file.resolve()}"


def _portable_name(name: str, library: dict[str, Path], path: Path) -> str:
    """Return a name that is valid in any folder: a library name, or an absolute path."""
    return name if path in library.values() else str(path.resolve())


@command.command(name="list", epilog="Example: mission task list --all")
@click.option("--all", "everything", is_flag=True, help="Include ended tasks.")
@AS_JSON
def list_command(everything: bool, as_json: bool) -> None:
    """List waiting and running tasks, by priority, then by due time."""
    now = wall_clock()
    with _queue() as (queue, _):
        tasks = [replace(task, due=queue.expected_time(task, now)) for task in queue.tasks(ended=everything)]
    if as_json:
        click.echo(json.dumps([_as_json(task) for task in tasks], indent=2))
    elif not tasks:
        click.echo("no tasks" if everything else "no waiting tasks; --all shows the ended ones")
    else:
        rows = [list_row(task) for task in tasks]
        headings = [name for name in rows[0] if name != "priority" or any(task.priority for task in tasks)]
        cells = [[row[name] for name in headings] for row in rows]
        click.echo(format_columns(headings, cells, left=frozenset(headings[1:]) - {"priority"}))
    for task in tasks:
        if not task.has_ended and task.added > now + MAX_CLOCK_ERROR:
            added_at = clock_text(task.added)
            warning = f"task {task.id} was added at {added_at}, in the future: the clock was wrong then, or is"
            cure = f"date; if it is right: mission task remove {task.id}, and add it again"
            click.echo(f"{warning} now\n  try: {cure}", err=True)


@command.command(epilog="Example: mission task approve 3")
@NUMBER
@click.option(
    "--by",
    default=_user_name,
    metavar="NAME",
    help="Name of the person who approves it; the default is the user of this computer.",
)
def approve(number: int, by: str) -> None:
    """Approve a task that was added with --needs-approval.

    Each repetition needs its own approval.
    """
    with _queue() as (queue, _):
        queue.approve(number, wall_clock(), by)
    click.echo(f"task {number} is approved")


@command.command(epilog="Example: mission task remove 3")
@NUMBER
def remove(number: int) -> None:
    """Cancel a task and its repetition; a running task is stopped safely."""
    with _queue() as (queue, _):
        state = queue.cancel(number, wall_clock())
    running = _is_served()
    stopping = "is being stopped" if running else "is cancelled as soon as `mission task serve` runs again"
    if running is None:
        stopping = "is cancelled, but may still be moving: mission stop"
    click.echo(f"task {number} {stopping if state == 'running' else 'is cancelled'}")


@command.command(epilog="Example: mission task move 3 --priority 5")
@NUMBER
@click.option("--priority", type=WholeNumber(*PRIORITIES), required=True, metavar="NUMBER", help="-100 to 100.")
def move(number: int, priority: int) -> None:
    """Change the priority of a waiting task.

    Due tasks with the highest priority run first.
    """
    with _queue() as (queue, _):
        queue.move(number, priority)
    click.echo(f"task {number} has priority {priority}")


@command.command(epilog="Example: mission task log 3")
@NUMBER
@AS_JSON
def log(number: int, as_json: bool) -> None:
    """Print the history of a task.

    Prints every attempt, and every notice with its delivery.
    """
    with _queue() as (queue, outbox):
        task, attempts, letters = queue.task(number), queue.attempts(number), outbox.notices_of(number)
    if as_json:
        data = {"task": _as_json(task), "attempts": [asdict(each) for each in attempts]}
        click.echo(json.dumps(data | {"notices": [asdict(each) for each in letters]}, indent=2))
        return
    reason = f": {task.reason}" if task.reason else ""
    click.echo(f"task {number}: {task.name}, {task.state.replace('_', ' ')}{reason}")
    click.echo(f"{clock_text(task.added)}  added, due {f'at {clock_text(task.due)}' if task.due else 'at once'}")
    if task.needs_approval:
        click.echo(
            "needs approval"
            if task.approved is None
            else f"{clock_text(task.approved)}  approved by {task.approved_by}"
        )
    for attempt in attempts:
        click.echo(describe_attempt(attempt))
    for letter in letters:
        click.echo(describe_notice(letter))
