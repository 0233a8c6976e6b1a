"""``mission task``: a queue of missions; ``mission task serve`` runs them."""

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

# How tasks, attempts and notices are told on a terminal.


def list_row(task: Task) -> Mapping[str, str]:
    """Return what the list says of a task, by heading."""
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
    """Return what the log says of an attempt."""
    if attempt.ended is None:
        return f"{clock_text(attempt.began)}  attempt {attempt.number} begins"
    reason = f": {attempt.reason}" if attempt.reason else ""
    seconds = attempt.ended - attempt.began
    return f"{clock_text(attempt.began)}  attempt {attempt.number}: {attempt.how} after {seconds:.0f} s{reason}"


def describe_notice(queued: QueuedNotice) -> str:
    """Return what the log says of a notice."""
    if queued.delivered is not None:
        return f"{clock_text(queued.delivered)}  delivered to {queued.channel}: {queued.notice.text}"
    why = f" ({queued.tries} tries; {queued.last_error})" if queued.tries else ""
    state = "never delivered, and given up," if queued.given_up else "not delivered yet"
    return f"{clock_text(queued.added)}  {state} to {queued.channel}{why}: {queued.notice.text}"


def clock_text(time: float) -> str:
    """Write a time, whatever stands in the file: of other calendars than ours, the bare number."""
    try:
        return f"{datetime.fromtimestamp(time, UTC).astimezone(local_zone()):%Y-%m-%d %H:%M:%S}"
    except (ValueError, OverflowError, OSError):
        return f"{time:g}"


DEFAULT_LATE_LIMIT = 3600.0
"""Seconds after which a task that has a time is missed, unless somebody says otherwise."""

POLICIES: Mapping[str, Interrupted] = {"": "retry", "retry": "retry", "give_up": "give-up"}
"""What is done about an interrupted task, by what its mission says of that."""


def _numbers(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the tasks that have not ended, as a shell completes them."""
    del ctx, param
    with suppress(click.ClickException), _queue() as (queue, _):
        tasks = queue.tasks(ended=False)
        return [
            CompletionItem(str(each.id), help=each.mission) for each in tasks if str(each.id).startswith(incomplete)
        ]
    return []


def _user_name() -> str:
    """Return who sits here: a name, or in a container without names, a number."""
    with suppress(KeyError, OSError):
        return getuser()
    return str(os.geteuid())


NUMBER = click.argument("number", metavar="TASK", type=WholeNumber(min=1), shell_complete=_numbers)
AS_JSON = click.option("--json", "as_json", is_flag=True, help="As JSON, for programs.")


MAX_CLOCK_ERROR = 60.0
"""Seconds that a task may have been added ahead of the clock, which is put right by as much now and then."""


@click.group(
    "task",
    cls=LazyGroup,
    epilog="Example: mission task list",
)
def command() -> None:
    """Queue missions, to be run in turn, at a time, or again and again; `mission task serve` runs them.

    The queue survives crashes and power cuts.
    """


@contextmanager
def _queue() -> Iterator[tuple[TaskQueue, Outbox]]:
    """Open the user's queue, and tell in words what goes wrong with it."""
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
@click.option("--at", metavar="TIME", help='When: "18:00", the next such time, or "2026-12-24 18:00". Else at once.')
@click.option("--every", metavar="TIME", help='Again and again: "30 min", day, monday, or "day 18:00".')
@click.option(
    "--late", type=SECONDS, metavar="TIME", help="Miss it, and say so, where it is later than this; else 1 h."
)
@click.option(
    "--priority",
    type=WholeNumber(*PRIORITIES),
    default=0,
    metavar="NUMBER",
    help="Of the tasks that are due, the highest is first: -100 to 100, else 0. What runs is not broken off.",
)
@click.option("--retry", type=WholeNumber(min=0), default=0, metavar="TIMES", help="Try again when it fails.")
@click.option(
    "--if-interrupted",
    "interrupted",
    type=click.Choice(["retry", "give-up"]),
    help="What to do where nobody knows how far it came, after a power cut, say. Else as its mission says, or retry.",
)
@click.option("--needs-approval", is_flag=True, help="Begin it once somebody approves it: mission task approve.")
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
    """Add a task: a mission (a name or a file), which is checked here and now, and run by `mission task serve`."""
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
    click.echo(f"task {number}: {new.name} {when}" + (f", then every {repetition}" if repetition else ""))
    if needs_approval:
        click.echo(f"it begins once somebody approves it: mission task approve {number}")
    if _is_served() is False:
        click.echo("nobody does tasks at the moment: mission task serve", err=True)
    return SUCCESS


def _is_served() -> bool | None:
    """Return whether a server does the tasks; None where that is not known, which is told."""
    try:
        return is_locked(server_lock(state_folder()))
    except OSError as error:
        click.echo(f"it is not known whether a server does the tasks: {error}", err=True)
        return None


def _as_json(task: Task) -> dict[str, object]:
    """Return a task for programs; of where it is told, what may be told of that."""
    return asdict(task) | {"channels": [public_text(each) for each in task.channels]}


def _check(request: RunRequest) -> Plan:
    """Return the mission; raise what `mission run` would raise for this order, before anything moves."""
    from missions.cli.request_checks import check_people  # noqa: PLC0415 - the other subcommands need none of what they import
    from missions.runner import load_plan, requested_robot  # noqa: PLC0415

    check_request(request)
    if request.simulation is not None:
        request.world_file()
    plan = load_plan(request, requested_robot(request))
    check_people(request, plan)
    return plan


def _when(at: str | None, every: str | None, time: float) -> tuple[float, str]:
    """Return when a task is due for the first time, and its repetition; 0 for as soon as its turn comes."""
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
    """Yield what `mission run` is to be told beside the mission, its params and the robot."""
    if request.simulate is not None:
        yield f"--simulate={request.simulate}"
    if isinstance(request.world, str):
        yield f"--world={_portable_name(request.world, shipped_files('worlds'), find_file('worlds', request.world))}"
    if request.eyes != "pixels":
        yield f"--eyes={request.eyes}"
    for file in request.behaviours:
        yield f"--behaviours={file.resolve()}"


def _portable_name(name: str, library: dict[str, Path], path: Path) -> str:
    """Return a name as the server understands it, wherever that runs: one in the library, or a whole path."""
    return name if path in library.values() else str(path.resolve())


@command.command(name="list", epilog="Example: mission task list --all")
@click.option("--all", "everything", is_flag=True, help="Also those that have ended.")
@AS_JSON
def list_command(everything: bool, as_json: bool) -> None:
    """List the tasks that wait or run, by priority, then in the order in which they are due."""
    now = wall_clock()
    with _queue() as (queue, _):
        tasks = [replace(task, due=queue.expected_time(task, now)) for task in queue.tasks(ended=everything)]
    if as_json:
        click.echo(json.dumps([_as_json(task) for task in tasks], indent=2))
    elif not tasks:
        click.echo("no tasks" if everything else "no tasks wait; --all shows those that have ended")
    else:
        rows = [list_row(task) for task in tasks]
        headings = [name for name in rows[0] if name != "priority" or any(task.priority for task in tasks)]
        cells = [[row[name] for name in headings] for row in rows]
        click.echo(format_columns(headings, cells, left=frozenset(headings[1:]) - {"priority"}))
    for task in tasks:
        if not task.has_ended and task.added > now + MAX_CLOCK_ERROR:
            said = f"task {task.id} was added at {clock_text(task.added)}, to come: the clock was wrong then, or is"
            cure = f"date; where that is right: mission task remove {task.id}, and add it anew"
            click.echo(f"{said} now\n  try: {cure}", err=True)


@command.command(epilog="Example: mission task approve 3")
@NUMBER
@click.option("--by", default=_user_name, metavar="NAME", help="Who approves it, if not the user of this computer.")
def approve(number: int, by: str) -> None:
    """Let a task begin that was added with --needs-approval; each of a repetition needs its own."""
    with _queue() as (queue, _):
        queue.approve(number, wall_clock(), by)
    click.echo(f"task {number} is approved")


@command.command(epilog="Example: mission task remove 3")
@NUMBER
def remove(number: int) -> None:
    """Cancel a task, and its repetition; one that runs is stopped safely."""
    with _queue() as (queue, _):
        state = queue.cancel(number, wall_clock())
    running = _is_served()
    stopping = "is being stopped" if running else "is cancelled as soon as `mission task serve` runs again"
    if running is None:
        stopping = "is cancelled; it is perhaps not stopped: mission stop"
    click.echo(f"task {number} {stopping if state == 'running' else 'is cancelled'}")


@command.command(epilog="Example: mission task move 3 --priority 5")
@NUMBER
@click.option("--priority", type=WholeNumber(*PRIORITIES), required=True, metavar="NUMBER", help="-100 to 100.")
def move(number: int, priority: int) -> None:
    """Give a task that waits another priority: of those that are due, the highest is first."""
    with _queue() as (queue, _):
        queue.move(number, priority)
    click.echo(f"task {number} has priority {priority}")


@command.command(epilog="Example: mission task log 3")
@NUMBER
@AS_JSON
def log(number: int, as_json: bool) -> None:
    """Say what became of a task: every attempt, and every notice with its delivery."""
    with _queue() as (queue, outbox):
        task, attempts, letters = queue.task(number), queue.attempts(number), outbox.notices_of(number)
    if as_json:
        told = {"task": _as_json(task), "attempts": [asdict(each) for each in attempts]}
        click.echo(json.dumps(told | {"notices": [asdict(each) for each in letters]}, indent=2))
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
