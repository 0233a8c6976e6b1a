"""``mission check``: report all errors in missions before a run."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from tempfile import NamedTemporaryFile

import click

from behaviours.leaf import Leaf
from config.diagnostics import Diagnostic, InvalidFileError, InvalidInputError, Mark, SourceText
from config.library import UnknownNameError
from config.yaml_edit import rewrite
from config.yaml_nodes import read_source
from missions.cli.default_robot import load_mission_for, load_target, robot_option, robots_for
from missions.cli.names import MISSION
from missions.cli.option_declarations import behaviours_option, params_option
from missions.cli.options import leaf_loader, mission_files_in
from missions.cli.outputs import report_write_errors
from missions.language.claims import impossible_alternatives
from missions.language.document import hidden_result_hints, unread_param_hints
from missions.language.draws import repeated_draw_hints
from missions.language.old_forms import rewrite_old_forms
from missions.language.outcomes import actions_as_guards, find_once_guards
from missions.language.phrases import confusions
from missions.language.takeover import early_action_hints
from missions.library.lookups import LOOKUPS
from missions.library.plugins import find_file_kind, load
from missions.library.shipped import find_mission, shipped_missions


@click.command(epilog="Example: mission check greet patrol")
@click.argument("names", type=MISSION, nargs=-1, metavar="[MISSION]...")
@robot_option
@click.option("--fix", is_flag=True, help="Rewrite old forms in the named files into newer ones with the same meaning.")
@click.option("--json", "as_json", is_flag=True, help="Write the errors as JSON, for editors and other programs.")
@params_option
@behaviours_option
def command(
    names: tuple[str, ...],
    robot: str | None,
    fix: bool,
    as_json: bool,
    params: dict[str, str],
    files: tuple[Path, ...],
) -> int:
    """Check missions and their tests: names, files or folders; without a name, all missions of MissionTree."""
    if fix and not names:
        raise click.UsageError("--fix needs the files to rewrite: mission check --fix FILE")
    robots = robots_for(robot)
    leaves = leaf_loader(files)
    found: list[Diagnostic] = []
    hints: list[Diagnostic] = []
    for name in [file for each in names for file in mission_files_in(each)] or list(shipped_missions()):
        summary, faults, advice = _check_file(name, params, robots, leaves, files)
        new = [fault for fault in faults if not any(fault.is_same(other) for other in found)]
        if len(new) < len(faults):  # errors of a mission that another file runs too
            summary = "\n".join([*map(str, new), f"{name}: {_errors(len(faults) - len(new))} as above"])
        found += new
        hints += advice
        if not as_json:
            click.echo(summary, err=bool(faults))
            for hint in advice:
                click.echo(f"hint: {hint}", err=True)
        if fix and not faults:
            for line in _fix_file(name, lambda path: _check_file(path, params, robots, leaves, files)[1]):
                click.echo(line, err=as_json)
    if as_json:
        entries = [_as_dict(fault, "error") for fault in found] + [_as_dict(hint, "hint") for hint in hints]
        click.echo(json.dumps(entries, indent=2, ensure_ascii=False))
    elif found:
        click.echo(_errors(len(found)), err=True)
    return 2 if found else 0


def _errors(count: int) -> str:
    return f"{count} error{'s' if count > 1 else ''}"


def _check_file(
    name: str,
    params: dict[str, str],
    robots: Sequence[Path],
    leaves: Callable[[str], Mapping[str, type[Leaf]]],
    files: Sequence[Path],
) -> tuple[str, Sequence[Diagnostic], Sequence[Diagnostic]]:
    """Check one file: a mission, for the first of ``robots`` that can do it, or a file of a plug-in, such as tests.

    ``leaves`` returns the leaves for a mission. Return the line to print, the errors, and the hints.
    """
    try:
        if (found := find_file_kind(Path(name).name)) is not None and found[1].check:
            plugin, kind = found
            return f"{name}: good ({load(plugin, kind.check)(Path(name), files)})", [], []
        plan, able = load_mission_for(name, params, robots, leaves(name))
    except InvalidFileError as error:
        return str(error), error.diagnostics, []
    except (InvalidInputError, UnknownNameError) as error:
        return f"mission: {error}", [Diagnostic(SourceText(name, ""), Mark(), str(error))], []
    count = sum(1 for _ in plan.tree.walk())
    other = "" if able == robots[0] else f", for robot '{able.stem}'"
    robot = load_target(able)
    summary = f"{name}: good ({plan.mission}, {count} node{'s' if count > 1 else ''}{other})"
    hints = [
        *unread_param_hints(plan),
        *hidden_result_hints(plan.tree),
        *actions_as_guards(plan.tree),
        *find_once_guards(plan.tree),
        *early_action_hints(plan.tree),
        *repeated_draw_hints(plan.tree),
        *impossible_alternatives(plan.tree, robot, LOOKUPS),
    ]
    return summary, [], [*hints, *confusions(plan.tree, robot)]


def _fix_file(name: str, check: Callable[[str], Sequence[Diagnostic]]) -> list[str]:
    """Rewrite the old forms of the mission language in a file without errors; return the lines to print.

    ``check`` returns the errors of a file. A form is left if the file would have errors without it.
    """
    if find_file_kind(Path(name).name) is not None:
        return []
    path = find_mission(name)
    with report_write_errors(path, "--fix"):
        return _rewrite_file(name, path, check)


def _rewrite_file(name: str, path: Path, check: Callable[[str], Sequence[Diagnostic]]) -> list[str]:
    """Rewrite the old forms in the file of a mission, and return the lines to print.

    The file stays as it is if it has other names, or if it has changed meanwhile. Raises OSError.
    """

    def is_good(text: str) -> bool:
        with NamedTemporaryFile(dir=path.parent, prefix=f".{path.stem[:100]}.", suffix=path.suffix) as trial:
            trial.write(text.encode())
            trial.flush()
            return not check(trial.name)

    data = path.read_bytes()
    text, rewrites = rewrite_old_forms(str(path), read_source(path).text, is_good)
    if not rewrites:
        return [f"{name}: no old form"]
    if path.stat().st_nlink > 1:
        return [f"{name}: not rewritten, since the file has other names (hard links), which would keep the old text"]
    if path.read_bytes() != data:
        return [f"{name}: not rewritten, since the file has changed meanwhile"]
    rewrite(path, text)
    return [f"{name}:{each.line}: rewritten as '{each.new}'" for each in rewrites]


def _as_dict(fault: Diagnostic, severity: str) -> dict[str, object]:
    """Return an error or a hint for editors; line and column count from 1."""
    return {
        "file": fault.source.name,
        "line": fault.mark.line,
        "column": fault.mark.column,
        "length": fault.mark.length,
        "message": fault.message,
        "suggestion": fault.suggestion,
        "severity": severity,
    }
