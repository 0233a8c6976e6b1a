"""``mission verify``: every run of a mission that leaves, conditions and time can lead to, up to a bound."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import click

from behaviours.leaf import Leaf
from config.faults import InvalidFileError
from config.library import UnknownNameError
from config.units import written
from drivers.clock import SystemClock
from missions.cli.declared import behaviours_option, params_option
from missions.cli.names import MISSION
from missions.cli.numbers import Whole
from missions.cli.options import SECONDS, files_of, leaves_for
from missions.cli.usual_robot import load_for, robot_option, robots_for
from missions.library.drivers import load_robot
from missions.library.shipped import shipped_missions
from missions.plugins.verify.explore import PROVED, Report
from missions.plugins.verify.judge import BOUND, LIMIT, verify


@click.command(epilog="Example: mission verify greet")
@click.argument("names", type=MISSION, nargs=-1, metavar="[MISSION]...")
@click.option(
    "--bound",
    type=Whole(min=1),
    default=BOUND,
    show_default=True,
    metavar="STATES",
    help="Give up after so many states; what was not decided by then counts as not proved.",
)
@click.option(
    "--limit",
    type=SECONDS,
    default=written(LIMIT, "duration"),
    show_default=True,
    metavar="TIME",
    help="Give up a mission after so long; what is certain by then is said.",
)
@robot_option
@click.option("--json", "as_json", is_flag=True, help="Write the verdicts as JSON, for editors and other programs.")
@params_option
@behaviours_option
def command(
    names: tuple[str, ...],
    bound: int,
    limit: float,
    robot: str | None,
    as_json: bool,
    params: dict[str, str],
    files: tuple[Path, ...],
) -> int:
    """Prove that missions can end, reach all their nodes, stop cleanly, and keep their `properties`.

    Takes names, files or folders; all that ship with MissionTree when none is given. Exits with 0 when all is proved,
    with 1 when something is refuted or not decided, and with 2 for a mission that `mission check` refuses.
    """
    robots = robots_for(robot)
    leaves = leaves_for(files)
    code = 0
    reports: list[Report] = []
    for name in [file for each in names for file in files_of(each, tests=False)] or list(shipped_missions()):
        report = _verified(name, params, robots, leaves, bound, limit)
        if report is None:
            code = 2
            continue
        reports.append(report)
        code = max(code, int(report.outcome != PROVED))
        if not as_json:
            click.echo(str(report))
    if as_json:
        click.echo(json.dumps([report.as_dict() for report in reports], indent=2, ensure_ascii=False))
    return code


def _verified(
    name: str,
    params: dict[str, str],
    robots: Sequence[Path],
    leaves: Callable[[str], Mapping[str, type[Leaf]]],
    bound: int,
    limit: float,
) -> Report | None:
    """Verify one mission; None, and its mistakes on stderr, where it cannot be read."""
    try:
        plan, able = load_for(name, params, robots, leaves(name))
    except InvalidFileError as error:
        click.echo(str(error), err=True)
    except UnknownNameError as error:
        click.echo(f"mission: {error}", err=True)
    else:
        seconds = load_robot(able).sensor_timeout
        return verify(plan, SystemClock(), bound=bound, limit=limit, sensor_timeout=seconds)
    return None
