"""``mission check``: every mistake in missions, before anything moves."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

import click

from behaviours.leaf import Leaf
from config.faults import Fault, InvalidFileError, Mark, Source
from config.library import UnknownNameError, find, shipped
from config.robot import load_robot
from missions.assembly.target import target_of
from missions.cli.options import behaviours_option, files_of, leaves_for, params_option
from missions.language.claims import Target
from missions.language.plan import Plan
from missions.library import TESTS, load_mission, shipped_missions
from missions.order import DEFAULT_ROBOT


@click.command()
@click.argument("names", nargs=-1, metavar="[MISSION]...")
@click.option("--robot", metavar="NAME", help="Check that this robot can do it (a name or a file).")
@click.option("--json", "as_json", is_flag=True, help="Write the mistakes as JSON, for editors and other programs.")
@params_option
@behaviours_option
def command(
    names: tuple[str, ...], robot: str | None, as_json: bool, params: dict[str, str], files: tuple[Path, ...]
) -> int:
    """Check missions and their tests: names, files or folders; all that ship with MissionTree when none is given."""
    robots = [find("robots", robot)] if robot is not None else _usual_first()
    leaves = leaves_for(files)
    found: list[Fault] = []
    for name in [file for each in names for file in files_of(each)] or list(shipped_missions()):
        said, faults = _checked(name, params, robots, leaves, files)
        found += faults
        if not as_json:
            click.echo(said, err=bool(faults))
    if as_json:
        click.echo(json.dumps([_as_dict(fault) for fault in found], indent=2, ensure_ascii=False))
    elif found:
        click.echo(f"{len(found)} mistake{'s' if len(found) > 1 else ''}", err=True)
    return 2 if found else 0


def _checked(
    name: str,
    params: dict[str, str],
    robots: Sequence[Path],
    leaves: Callable[[str], Mapping[str, type[Leaf]]],
    files: Sequence[Path],
) -> tuple[str, Sequence[Fault]]:
    """Check one mission for the first of ``robots``, or one file of tests; return what to tell, and its mistakes.

    What ships is good where one of the other robots can do it.
    """
    able = ""
    try:
        if Path(name).name.endswith(TESTS):
            from missions.testing.suite import load_suite  # noqa: PLC0415 - brings the whole simulation along

            cases = len(load_suite(Path(name), files))
            return f"{name}: good ({cases} case{'s' if cases > 1 else ''})", []
        own = leaves(name)
        try:
            plan = load_mission(name, params=params, robot=_target(robots[0]), leaves=own)
        except InvalidFileError as error:
            found = _otherwise(name, params, robots[1:], own)
            if found is None:
                raise
            plan, able = found
            if not able or plan.source.name not in map(str, shipped_missions().values()):
                cure = f"robot '{able}' can do it: --robot {able}" if able else "for another robot: --robot NAME"
                return f"{error}\n  {name} was checked for the usual robot; {cure}", error.faults
    except InvalidFileError as error:
        return str(error), error.faults
    except UnknownNameError as error:
        return f"mission: {error}", [Fault(Source(name, ""), Mark(), str(error))]
    count = sum(1 for _ in plan.tree.walk())
    other = f", for robot '{able}'" if able else ""
    return f"{name}: good ({plan.mission}, {count} node{'s' if count > 1 else ''}{other})", []


def _usual_first() -> list[Path]:
    """Return the files of the robots that ship: first the one that a run takes where none is named."""
    files = shipped("robots")
    return [files.pop(DEFAULT_ROBOT), *files.values()]


def _otherwise(
    name: str, params: dict[str, str], robots: Sequence[Path], leaves: Mapping[str, type[Leaf]]
) -> tuple[Plan, str] | None:
    """Return the plan with the robot among ``robots`` that can do it; no name for one that is right but for the robot.

    None where it is wrong whatever the robot, or where there is no other robot.
    """
    if not robots:
        return None
    with suppress(InvalidFileError):
        plan = load_mission(name, params=params, leaves=leaves)
        for path in robots:
            with suppress(InvalidFileError):
                return load_mission(name, params=params, robot=_target(path), leaves=leaves), path.stem
        return plan, ""
    return None


@cache
def _target(robot: Path) -> Target:
    return target_of(load_robot(robot))


def _as_dict(fault: Fault) -> dict[str, object]:
    """Return a mistake as an editor takes it; line and column count from 1."""
    return {
        "file": fault.source.name,
        "line": fault.mark.line,
        "column": fault.mark.column,
        "length": fault.mark.length,
        "message": fault.message,
        "suggestion": fault.suggestion,
    }
