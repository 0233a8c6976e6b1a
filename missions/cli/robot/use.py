"""``mission robot use``: the robot that this computer has, or none."""

from pathlib import Path

import click

from config.defaults import FILE, config_folder, drop_default, keep_default, load_defaults
from config.editing import NotEditableError
from config.library import find, shipped
from config.writing import word
from missions.cli.names import ROBOT
from missions.cli.outputs import writing
from missions.cli.robot.first import able
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot


@click.command(epilog="Example: mission robot use turtlebot2_arm")
@click.argument("name", required=False, type=ROBOT)
@click.option("--none", "no_robot", is_flag=True, help="Let this computer have no robot of its own any more.")
def use(name: str | None, no_robot: bool) -> int:
    """Make a robot this computer's own: NAME is a name or a file.

    `mission run greet --on-robot` moves it then, `--robot mine` is it for every command, and what is simulated without
    a --robot is it too. --none undoes that; the robot's file stays.
    """
    if no_robot == (name is not None):
        raise click.UsageError("name a robot, or say --none: one of them")
    if name is None:
        return _forget()
    path = find("robots", name)
    config = load_robot(path)
    stays = name if name in shipped("robots") or not Path(name).is_file() else str(path.resolve())
    try:
        with writing(config_folder() / FILE, "NAME"):
            kept = keep_default("robot", word(stays))
    except NotEditableError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"{stays} is this computer's robot now: {kept}")
    mission = able(config)
    click.echo(f"  next: mission run {mission} --on-robot" if mission else "  next: mission robot check")
    return SUCCESS


def _forget() -> int:
    """Let this computer have no robot of its own."""
    before = load_defaults().robot
    if not before:
        click.echo("this computer has no robot of its own")
        return SUCCESS
    try:
        with writing(config_folder() / FILE, "--none"):
            kept = drop_default("robot")
    except NotEditableError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"{before} is this computer's robot no more: {kept}")
    return SUCCESS
