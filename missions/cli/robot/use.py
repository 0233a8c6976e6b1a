"""``mission robot use``: the robot that this computer has; and what a run takes where it names none."""

from pathlib import Path

import click

from config.defaults import keep_default, load_defaults
from config.editing import NotEditableError
from config.library import MINE, find, shipped
from config.writing import word
from missions.cli.root import SUCCESS
from missions.library.drivers import load_robot
from missions.order import Simulate


@click.command(epilog="Example: mission robot use turtlebot2_arm")
@click.argument("name")
def use(name: str) -> int:
    """Make a robot this computer's own: NAME is a name or a file.

    `mission run greet --on-robot` moves it then, `--robot mine` is it for every command, and what is simulated without
    a --robot is it too.
    """
    path = find("robots", name)
    load_robot(path)
    stays = name if name in shipped("robots") or not Path(name).is_file() else str(path.resolve())
    try:
        kept = keep_default("robot", word(stays))
    except NotEditableError as error:
        raise click.UsageError(str(error)) from error
    click.echo(f"{stays} is this computer's robot now: {kept}")
    click.echo("  next: mission run greet --on-robot")
    return SUCCESS


def usual(
    robot: str | None, simulate: Simulate | None, world: str | None, *, on_robot: bool
) -> tuple[str | None, Simulate | None, str | None]:
    """Return robot, simulation and world of a run, with the user's defaults where they were not named.

    Raises click.UsageError for options that contradict each other, InvalidFileError for a wrong file of defaults.
    """
    if on_robot and (robot is not None or simulate is not None):
        other = "--robot names another" if robot is not None else "--simulate moves none"
        raise click.UsageError(f"--on-robot moves this computer's robot, {other}: one of them")
    defaults = load_defaults()
    if on_robot or robot == MINE:
        find("robots", MINE)
        robot = defaults.robot  # records keep a name that means the same tomorrow
    elif robot is None and defaults.robot:
        robot, simulate = defaults.robot, simulate or "wire"
    if world is None and defaults.world and (robot is None or simulate is not None):
        world = defaults.world
    return robot, simulate, world
