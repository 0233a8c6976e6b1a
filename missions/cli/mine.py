"""What a run takes of the user's defaults, where its command names nothing."""

import click

from config.defaults import load_defaults
from config.library import MINE, find
from missions.order import Simulate


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
