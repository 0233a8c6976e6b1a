"""``mission fleet run``, ``tasks`` and ``decide``: give tasks to a fleet and follow them."""

import json
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import Literal

import click

from behaviours.catalogue import LEAVES
from config.diagnostics import InvalidFileError
from config.fleet import FleetKeys, load_fleet
from config.library import UnknownNameError
from missions.cli.commands import SharingCommand, shared_option
from missions.cli.numbers import WholeNumber
from missions.cli.option_declarations import params_option
from missions.cli.printable import format_columns
from missions.cli.root import FAILURE, SUCCESS
from missions.language.expressions import ExpressionError, parse
from missions.library.shipped import MISSION_NAME, load_mission
from missions.plugins.fleet.messages import TASK_ID_PATTERN, Address, FleetTaskInfo, KeepTask
from missions.plugins.fleet.operator import Operator, connect_operator
from missions.plugins.tasks.task import Interrupted, TaskError

# Connection to a fleet for a terminal command.

FLEET = shared_option(
    "--fleet", "name", metavar="NAME", help="Name of the fleet; the default is that of fleet.yaml, or `home`."
)
AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


def fleet_of(name: str | None) -> FleetKeys:
    """Return the configuration in fleet.yaml, with the fleet's name replaced by ``name`` if given."""
    found = load_fleet()
    return found if name is None else replace(found, fleet=name)


@contextmanager
def open_operator(name: str | None) -> Iterator[Operator]:
    """Connect an operator to a fleet for the duration of a command; errors become click exceptions."""
    try:
        with connect_operator(fleet_of(name)) as operator:
            yield operator
    except TaskError as error:
        hint = f"\n  try: {error.hint}" if error.hint else ""
        raise click.ClickException(f"{error}{hint}") from error


READABLE_FIELDS = frozenset({"battery", "x", "y", "name", "robot", "parts", "simulated"})
"""Names of a robot's state and address that an expression of `--where` may read."""


@click.command(cls=SharingCommand, epilog='Example: mission fleet run greet --on any --where "battery > 40 %"')
@click.argument("mission")
@params_option
@FLEET
@click.option("--on", default="any", show_default=True, metavar="NAME", help="Robot: a name, `any` or `all`.")
@click.option("--where", default="", metavar="CONDITION", help='Condition on the robot: "battery > 40 %", "x < 3 m".')
@click.option(
    "--if-interrupted",
    "interrupted",
    type=click.Choice(["retry", "give-up"]),
    help="Action if it was interrupted; the default is that of the mission, or retry.",
)
@click.option(
    "--retry", type=WholeNumber(min=0, max=1000), default=0, metavar="TIMES", help="Number of retries after a failure."
)
@click.option(
    "--id", "number", metavar="TASK", help="ID of an earlier attempt to add this task, which prevents adding it twice."
)
def run(
    mission: str,
    params: dict[str, str],
    name: str | None,
    on: str,
    where: str,
    interrupted: Interrupted | None,
    retry: int,
    number: str | None,
) -> int:
    """Give a mission to one robot of a fleet, or to each.

    The mission is one of the library; a robot runs it as soon as it is free.

    One of the robots keeps the task and decides which robot runs it. The mission is read on the robot that runs it.
    """
    _check(mission, where, on, number)
    policy = interrupted or _policy(mission)
    with open_operator(name) as operator:
        operator.discover()
        names = sorted(a.name for a, each in operator.members().items() if each.is_online) if on == "all" else [on]
        code = SUCCESS
        for each in names:
            keeper = operator.choose_allocator(each) if number is None else Address.read(number.rpartition("/")[0])
            task = number or f"{keeper}/{secrets.token_hex(6)}"
            request = KeepTask(
                task=task, mission=mission, params=params, on=each, where=where,
                if_interrupted=policy, retries=retry, by=operator.by,
            )  # fmt: skip
            answer = operator.submit(request, keeper)
            code = code if answer.ok else FAILURE
            click.echo(
                f"task {task}: {mission} on {each}" if answer.ok else f"refused: {answer.reason}", err=not answer.ok
            )
        if not names:
            click.echo(
                "no robots connected to this fleet\n  try, on the robot: mission task serve --fleet NAME", err=True
            )
            code = FAILURE
    return code


def _check(mission: str, where: str, on: str, number: str | None) -> None:
    """Raise click.UsageError for a mission, condition or ID that every robot would refuse."""
    if not MISSION_NAME.fullmatch(mission):
        raise click.UsageError(f"'{mission}' is not a library name; robots of a fleet have only their own files")
    if number is not None and (not TASK_ID_PATTERN.fullmatch(number) or on == "all"):
        raise click.UsageError("--id must be a task ID printed by `mission fleet run`")
    try:
        condition = parse(where) if where else None
    except ExpressionError as error:
        raise click.UsageError(f"--where: {error}") from error
    unknown = set() if condition is None else set(condition.names) - READABLE_FIELDS
    if condition is not None and condition.draws:
        raise click.UsageError("--where: 'random' has values only in the run of a mission")
    if unknown:
        raise click.UsageError(
            f"--where: '{min(unknown)}' is not a property of a robot; known: {', '.join(sorted(READABLE_FIELDS))}"
        )


def _policy(mission: str) -> Interrupted:
    """Return the mission's policy for interruptions if this computer's library has the mission, else "retry"."""
    try:
        policy = load_mission(mission, leaves=LEAVES).if_interrupted
    except (InvalidFileError, UnknownNameError):
        return "retry"
    return "give-up" if policy == "give_up" else "retry"


@click.command(cls=SharingCommand, epilog="Example: mission fleet tasks --all")
@FLEET
@click.option("--all", "ended", is_flag=True, help="Include ended tasks.")
@AS_JSON
def tasks(name: str | None, ended: bool, as_json: bool) -> int:
    """List the tasks of the connected robots, with the robot and the state of each."""
    with open_operator(name) as operator:
        task_list = operator.tasks(ended=ended)
    found = sorted(task_list.tasks, key=lambda each: each.id)
    for each in sorted(task_list.more):
        click.echo(f"{each} has more tasks, older than the ones shown", err=True)
    for each in sorted(task_list.silent):
        click.echo(f"{each} did not answer; its tasks may be missing", err=True)
    if as_json:
        click.echo(json.dumps([asdict(each) for each in found]))
    elif not found:
        click.echo("no tasks" if ended else "no waiting or running tasks; --all shows the ended ones")
    else:
        headings = ("task", "state", "mission", "on", "robot", "reason")
        click.echo(format_columns(headings, [_row(each) for each in found], left=frozenset(headings)))
    return SUCCESS


def _row(task: FleetTaskInfo) -> list[str]:
    return [task.id, task.state, task.mission, task.on, task.robot.partition("/")[0] or "-", task.reason]


@click.command(cls=SharingCommand, epilog="Example: mission fleet decide 3f9a reassign")
@click.argument("number", metavar="TASK")
@click.argument("what", type=click.Choice(["reassign", "give-up"]))
@FLEET
def decide(number: str, what: Literal["reassign", "give-up"], name: str | None) -> int:
    """Give a task of a lost robot to another one, or give it up.

    The last characters of the task ID are enough.

    After `reassign` the task is done twice if the lost robot continues with it, so look first.
    """
    with open_operator(name) as operator:
        answer = operator.decide(_full_id(operator, number), what)
    click.echo(f"task {number}: {answer.reason}", err=not answer.ok)
    return SUCCESS if answer.ok else FAILURE


def _full_id(operator: Operator, number: str) -> str:
    """Return the full ID of the task whose ID contains ``number``. Raises TaskError unless exactly one matches."""
    if TASK_ID_PATTERN.fullmatch(number):
        return number
    found = [each.id for each in operator.tasks(ended=False).tasks if number in each.id.rpartition("/")[2]]
    if len(found) != 1:
        many = f"{len(found)} tasks that wait or run have '{number}' in their ID" if found else ""
        raise TaskError(many or f"no waiting or running task has '{number}' in its ID", hint="mission fleet tasks")
    return found[0]
