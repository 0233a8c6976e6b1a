"""``mission verify``: checks all runs of a mission, up to a bound."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import click

from behaviours.leaf import Leaf
from config.diagnostics import InvalidFileError
from config.library import UnknownNameError
from config.units import quantity_text
from drivers.clock import ProcessClock
from missions.cli.default_robot import load_mission_for, robot_option, robots_for
from missions.cli.names import MISSION
from missions.cli.numbers import WholeNumber
from missions.cli.option_declarations import behaviours_option, params_option
from missions.cli.options import SECONDS, leaf_loader, mission_files_in
from missions.library.drivers import load_robot
from missions.library.shipped import shipped_missions
from missions.plugins.verify.explore import PROVED, VerificationReport
from missions.plugins.verify.verdicts import MAX_STATES, TIME_LIMIT, verify


@click.command(epilog="Example: mission verify greet")
@click.argument("names", type=MISSION, nargs=-1, metavar="[MISSION]...")
@click.option(
    "--bound",
    type=WholeNumber(min=1),
    default=MAX_STATES,
    show_default=True,
    metavar="STATES",
    help="Maximum number of states; rules undecided by then count as not proved.",
)
@click.option(
    "--limit",
    type=SECONDS,
    default=quantity_text(TIME_LIMIT, "duration"),
    show_default=True,
    metavar="TIME",
    help="Limit on the CPU time for each mission; what is proved by then is reported.",
)
@robot_option
@click.option("--json", "as_json", is_flag=True, help="Print the verdicts as JSON.")
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
    """Verify that missions can end, reach all their nodes, stop cleanly, and keep their `properties`.

    Arguments are names, files or folders; by default all missions shipped with MissionTree. Exit codes: 0 all is
    proved; 1 a rule is refuted or undecided; 2 `mission check` rejects a mission.
    """
    robots = robots_for(robot)
    leaves = leaf_loader(files)
    code = 0
    reports: list[VerificationReport] = []
    for name in [file for each in names for file in mission_files_in(each, tests=False)] or list(shipped_missions()):
        report = _verify_mission(name, params, robots, leaves, bound, limit)
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


def _verify_mission(
    name: str,
    params: dict[str, str],
    robots: Sequence[Path],
    leaves: Callable[[str], Mapping[str, type[Leaf]]],
    bound: int,
    limit: float,
) -> VerificationReport | None:
    """Verify one mission; return None, after printing its errors on stderr, if it cannot be read."""
    try:
        plan, able = load_mission_for(name, params, robots, leaves(name))
    except InvalidFileError as error:
        click.echo(str(error), err=True)
    except UnknownNameError as error:
        click.echo(f"mission: {error}", err=True)
    else:
        seconds = load_robot(able).sensor_timeout
        return verify(plan, ProcessClock(), bound=bound, limit=limit, sensor_timeout=seconds)
    return None
