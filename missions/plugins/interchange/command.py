"""``mission import``: missions from behaviour trees of other programs."""

import shlex
from collections.abc import Collection, Mapping
from pathlib import Path

import click

from behaviours.leaf import Leaf
from config.diagnostics import SourceText
from config.file_io import save_file
from config.yaml_nodes import read_source
from missions.cli.option_declarations import behaviours_option
from missions.cli.outputs import check_folder, report_write_errors
from missions.library.vocabulary import behaviour_files_beside, load_leaves
from missions.plugins.interchange.importer import REPORT_NAME, ImportedProject, import_python_tree, import_trees
from missions.plugins.interchange.leaf_rules import LeafRule, read_rules
from missions.plugins.interchange.python_trees import TARGET, PythonTreeError
from missions.plugins.interchange.written_leaves import LeafClasses, find_written_tags, head_of, merge_stubs, tags_in


@click.command("import", epilog="Example: mission import patrol.xml -o patrol")
@click.argument("source", metavar="FILE.xml|FOLDER|MODULE:FUNCTION")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    metavar="FOLDER",
    help="Folder for the missions; it is created if necessary.",
)
@click.option(
    "--leaves",
    "table",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    metavar="TABLE.yaml",
    help="Behaviours that replace leaves, {leaves: {Say: {leaf: say, ports: {words: text}}}}: see docs/interchange.md.",
)
@click.option("--force", is_flag=True, help="Replace existing missions; leaves in FOLDER/behaviours are kept.")
@behaviours_option
def command(source: str, output: Path, table: Path | None, files: tuple[Path, ...], *, force: bool) -> None:
    """Make missions of behaviour trees: XML of BehaviorTree.CPP 3 and 4, Nav2 and py_trees.

    Each tree becomes a mission, and each subtree a mission that others run. Ports become params and results, entries of
    the blackboard become variables. Leaves that MissionTree does not have become stub leaves in FOLDER/behaviours: they
    can be checked, shown and mocked, and refuse to run until you write them. FOLDER/IMPORTED.md lists everything that
    is not as in the original. Nothing in the file is executed.

    For trees that run each other, import their folder. MODULE:FUNCTION is a function that returns a tree of py_trees,
    such as robot.trees:patrol or trees.py:patrol. Only then is a module imported, and its function called.
    """
    check_folder(output, "-o", f"-o {shlex.quote(str(output.with_suffix('')))}")
    leaves = load_leaves(files)
    present = {file: tags_in(read_source(file)) for file in behaviour_files_beside(output / REPORT_NAME)}
    imported = _import(source, leaves, None if table is None else read_rules(table, leaves), find_written_tags(present))
    _check_output(output, imported, force=force)
    kept = _keep_leaves(output, imported, present)
    with report_write_errors(output, "-o"):
        for name, text in imported.files.items():
            target = output / name
            target.parent.mkdir(parents=True, exist_ok=True)
            save_file(target, text, durable=False)
    for line in imported.report.lines():
        click.echo(line)
    click.echo(f"wrote {_counted(imported)} to {output}")
    for line in kept:
        click.echo(line)
    own = (f"--behaviours {shlex.quote(str(each))}" for each in files)
    click.echo(f"  next: {' '.join(('mission check', shlex.quote(str(output)), *own))}")


def _import(
    source: str, leaves: Mapping[str, type[Leaf]], rules: dict[str, LeafRule] | None, written: Collection[str]
) -> ImportedProject:
    """Import XML files or a Python tree. Raises click.BadParameter if there is no such thing."""
    path = Path(source)
    if path.exists():
        return import_trees(path, leaves, rules, written)
    if TARGET.fullmatch(source) is None:
        hint = "try: a file, a folder, or MODULE:FUNCTION for a tree of py_trees"
        raise click.BadParameter(f"'{source}' does not exist\n  {hint}", param_hint="SOURCE")
    try:
        return import_python_tree(source, leaves, rules, written)
    except PythonTreeError as error:
        hint = "try: MODULE:FUNCTION or FILE.py:FUNCTION, where FUNCTION returns the root of a tree of py_trees"
        raise click.BadParameter(f"'{source}' cannot be read: {error}\n  {hint}", param_hint="SOURCE") from error


def _keep_leaves(folder: Path, imported: ImportedProject, present: Mapping[Path, LeafClasses]) -> list[str]:
    """Keep the leaves in ``present``, the Python files of earlier imports, and return lines about them.

    Raises InvalidFileError.
    """
    lines = list[str]()
    for name in [each for each in imported.files if each.endswith(".py")]:
        file, text = folder / name, imported.files.pop(name)
        elsewhere = {tag for other, tags in present.items() if other != file for tag in tags}
        source = read_source(file) if file.exists() else SourceText(str(file), head_of(text))
        merged = merge_stubs(source, text, elsewhere)
        imported.stubs = len(merged.added)
        if merged.added:
            imported.files[name] = merged.text
        if file.exists():
            lines.append(f"kept the leaves in {file}")
        lines += (f"  '{tag}' is a stub with other ports: to replace it, delete its class" for tag in merged.outdated)
    return lines


def _counted(imported: ImportedProject) -> str:
    missions = f"{imported.missions} mission{'s' if imported.missions != 1 else ''}"
    if not imported.stubs:
        return missions
    return f"{missions} and {imported.stubs} stub {'leaves' if imported.stubs > 1 else 'leaf'}"


def _check_output(folder: Path, imported: ImportedProject, *, force: bool) -> None:
    """Raise click.BadParameter for a file that would be replaced, or for a link, a pipe or a folder in its place."""
    for name in imported.files:
        target = folder / name
        if target.is_symlink() or target.parent.is_symlink():
            raise click.BadParameter(f"{target} is a link: choose another folder", param_hint="-o")
        if target.exists() and not target.is_file():
            raise click.BadParameter(f"{target} is not a regular file: choose another folder", param_hint="-o")
        if target.exists() and not force:
            others = sum((folder / each).exists() for each in imported.files) - 1
            more = f", and {others} more files" if others else ""
            kept = "; the leaves in FOLDER/behaviours are kept" if imported.stubs else ""
            hint = f"try: another folder, or --force to replace them{kept}"
            raise click.BadParameter(f"{target} already exists{more}\n  {hint}", param_hint="-o")
