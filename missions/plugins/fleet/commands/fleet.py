"""``mission fleet``: list, stop and release the robots of a fleet."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from threading import Event

import click

from missions.cli.commands import LazyGroup
from missions.cli.printable import format_columns
from missions.cli.root import FAILURE, SUCCESS
from missions.plugins.fleet.commands import fleet_tasks
from missions.plugins.fleet.commands.fleet_tasks import AS_JSON, FLEET, open_operator
from missions.plugins.fleet.operator import Operator
from missions.plugins.fleet.zenoh_transport import RosterEntry

WATCH_INTERVAL = 0.2
"""Seconds between two checks of the fleet's roster for changes."""


@click.group("fleet", cls=LazyGroup, epilog="Example: mission fleet list")
def command() -> None:
    """List the robots of a fleet, give them tasks, and stop them.

    A robot joins with `mission task serve --fleet NAME`.
    """


@command.command(name="list", epilog="Example: mission fleet list --watch")
@FLEET
@click.option("--watch", is_flag=True, help="Update the list at each change.")
@AS_JSON
def list_command(name: str | None, watch: bool, as_json: bool) -> int:
    """List the robots: connection, mission, battery, odometry position and state."""
    with open_operator(name) as operator:
        operator.discover()
        _show(operator, as_json=as_json)
        version, pause = operator.roster.version, Event()
        while watch:
            pause.wait(WATCH_INTERVAL)
            if version != operator.roster.version:
                version = operator.roster.version
                click.echo()
                _show(operator, as_json=as_json)
    return SUCCESS


def _show(operator: Operator, *, as_json: bool) -> None:
    members = sorted(operator.members().values(), key=lambda each: each.address)
    if as_json:
        lines = [
            {**asdict(each.address), "connection": each.connection, "state": each.state and asdict(each.state)}
            for each in members
        ]
        click.echo(json.dumps(lines))
        return
    names = [each.address.name for each in members]
    rows = [list(_row(each, twice=names.count(each.address.name) > 1)) for each in members]
    rows += [[name, "OFFLINE", "-", "-", "-", "-", "it has not been seen"] for name in operator.missing_robots()]
    if not rows:
        click.echo(
            f"no robots in fleet '{operator.fleet.fleet}'\n  try: mission task serve --fleet {operator.fleet.fleet}"
        )
        return
    headings = ("name", "connection", "robot", "mission", "battery", "at", "state")
    click.echo(format_columns(headings, rows, left=frozenset(headings)))


def _row(member: RosterEntry, *, twice: bool) -> Iterator[str]:
    """Yield the table cells of a robot; with ``twice``, two robots share its name, so its number is added."""
    state = member.state
    yield str(member.address) if twice else member.address.name
    yield member.connection
    if state is None:
        yield from ("-", "-", "-", "-", "")
        return
    yield state.robot + " (simulated)" * state.simulated
    yield state.mission or "-"
    yield "-" if state.battery is None else f"{state.battery:.0%}"
    yield "-" if state.x is None or state.y is None else f"{state.x:.1f} m, {state.y:.1f} m"
    doing = f"{state.task_state} {state.task}" if state.task_state else "free" if state.free else "busy"
    yield f"STOPPED by {state.stopped}" if state.stopped else doing


@command.command(epilog="Example: mission fleet stop")
@FLEET
def stop(name: str | None) -> int:
    """Stop and latch all robots until `mission fleet release`.

    Each robot confirms the stop. A robot that does not confirm is listed, since the stop may not have reached it: go
    there, or press its stop.
    """
    with open_operator(name) as operator:
        answers, silent = operator.stop()
    for address, answer in sorted(answers.items()):
        click.echo(f"{address.name}: {answer.reason}")
    for each in silent:
        click.echo(f"{each}: DID NOT ANSWER\n  try: mission stop, at that robot", err=True)
    if not answers and not silent:
        click.echo("no robots in this fleet; nothing was stopped\n  try: mission fleet list", err=True)
        return FAILURE
    return FAILURE if silent or not all(each.ok for each in answers.values()) else SUCCESS


@command.command(epilog="Example: mission fleet release anna")
@click.argument("robots", nargs=-1, metavar="[ROBOT]...")
@FLEET
@click.option("--resume", is_flag=True, help="Resume the missions, instead of leaving them paused.")
def release(robots: tuple[str, ...], name: str | None, resume: bool) -> int:
    """Release the stop of all robots, or of the named ones. A newer stop stays latched.

    ROBOT is a name, or NAME/NUMBER if two robots have the same name.
    """
    with open_operator(name) as operator:
        answers = operator.release(robots, resume=resume)
    for address, answer in sorted(answers.items()):
        click.echo(f"{address.name}: {answer.reason}", err=not answer.ok)
    missing = set(robots) - {each.name for each in answers} - {str(each) for each in answers}
    for each in sorted(missing):
        click.echo(f"{each}: did not answer\n  try: mission fleet list", err=True)
    return SUCCESS if answers and not missing and all(each.ok for each in answers.values()) else FAILURE


for each_command in (fleet_tasks.run, fleet_tasks.tasks, fleet_tasks.decide):
    command.add_command(each_command)
