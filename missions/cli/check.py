"""``mission check``: every mistake in missions, before anything moves."""

from pathlib import Path

import click

from config.faults import InvalidFileError
from config.library import find
from config.robot import load_robot
from missions.cli.options import params_option
from missions.library import load_mission, shipped_missions


@click.command()
@click.argument("names", nargs=-1, metavar="[MISSION]...")
@click.option("--robot", metavar="NAME", help="Check that this robot can do it (a name or a file).")
@params_option
def command(names: tuple[str, ...], robot: str | None, params: dict[str, str]) -> int:
    """Check missions: names, files or folders; all that ship with MissionTree when none is given."""
    target = None
    if robot is not None:
        config = load_robot(find("robots", robot))
        target = (config.name, config.parts)
    wrong = 0
    chosen = [file for name in names for file in _files(name)] or list(shipped_missions())
    for name in chosen:
        try:
            plan = load_mission(name, params=params, robot=target)
        except InvalidFileError as error:
            click.echo(str(error), err=True)
            wrong += len(error.faults)
        else:
            click.echo(f"{name}: good ({plan.mission}, {sum(1 for _ in plan.tree.walk())} nodes)")
    if wrong:
        click.echo(f"{wrong} mistake{'s' if wrong > 1 else ''}", err=True)
    return 2 if wrong else 0


def _files(name: str) -> list[str]:
    """Return the missions that a name means: itself, or every YAML file in a folder."""
    folder = Path(name)
    if not folder.is_dir():
        return [name]
    return [str(path) for path in sorted(folder.glob("*.yaml"))]
