"""``mission robot use``: the robot that this computer has."""

from pathlib import Path

import click

from config.defaults import FILE, config_folder, keep_default
from config.editing import NotEditableError
from config.library import find, shipped
from config.writing import word
from missions.cli.names import ROBOT
from missions.cli.outputs import writing
from missions.cli.robot.first import able
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot


@click.command(epilog="Example: mission robot use turtlebot2_arm")
@click.argument("name", type=ROBOT)
def use(name: str) -> int:
    """Make a robot this computer's own: NAME is a name or a file.

    `mission run greet --on-robot` moves it then, `--robot mine` is it for every command, and what is simulated without
    a --robot is it too.
    """
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
