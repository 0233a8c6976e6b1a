"""``mission check``: every mistake in missions, before anything moves."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import click

from behaviours.leaf import Leaf
from config.faults import Fault, InvalidFileError, Mark, Source
from config.library import UnknownNameError, find
from config.robot import load_robot
from missions.assembly.target import target_of
from missions.cli.options import behaviours_option, files_of, params_option
from missions.language.claims import Target
from missions.library import TESTS, load_mission, shipped_missions
from missions.order import DEFAULT_ROBOT
from missions.vocabulary import vocabulary


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
    target = target_of(load_robot(find("robots", robot or DEFAULT_ROBOT)))
    leaves = vocabulary(files)
    found: list[Fault] = []
    for name in [file for each in names for file in files_of(each)] or list(shipped_missions()):
        said, faults = _checked(name, params, target, leaves, named=robot is not None)
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
    target: Target,
    leaves: Mapping[str, type[Leaf]],
    *,
    named: bool,
) -> tuple[str, Sequence[Fault]]:
    """Check one mission, or one file of tests; return what to tell of it, and its mistakes.

    Where no robot is ``named``, whose parts are to be there, only what it listens for is checked for the usual one.
    """
    robot, ears = (target, None) if named else (None, target)
    try:
        if Path(name).name.endswith(TESTS):
            from missions.testing.suite import load_suite  # noqa: PLC0415 - brings the whole simulation along

            cases = len(load_suite(Path(name)))
            return f"{name}: good ({cases} case{'s' if cases > 1 else ''})", []
        plan = load_mission(name, params=params, robot=robot, ears=ears, leaves=leaves)
    except InvalidFileError as error:
        return str(error), error.faults
    except UnknownNameError as error:
        return f"mission: {error}", [Fault(Source(name, ""), Mark(), str(error))]
    count = sum(1 for _ in plan.tree.walk())
    return f"{name}: good ({plan.mission}, {count} node{'s' if count > 1 else ''})", []


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
