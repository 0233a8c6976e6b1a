"""Exports missions and imports them again, and compares their trees."""

import ast
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

from behaviours.leaf import Leaf
from missions.language.document import load_plan
from missions.language.expressions import Expression, Template, Value, parse
from missions.language.parallel_counts import decide_parallel
from missions.language.plan import Plan, Step
from missions.library.lookups import LOOKUPS
from missions.library.shipped import find_mission
from missions.library.vocabulary import load_leaves
from missions.plugins.interchange.exporter import export_mission
from missions.plugins.interchange.importer import import_trees
from missions.plugins.interchange.tree_writer import ExportedTree


def write_import(xml: Path, folder: Path, leaves: Mapping[str, type[Leaf]]) -> None:
    """Import a file into a folder."""
    for name, text in import_trees(xml, leaves).files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")


def plan_of(path: Path, leaves: Mapping[str, type[Leaf]] | None = None) -> Plan:
    """Read a mission, with the leaves beside it unless ``leaves`` are given."""
    own = load_leaves(sorted((path.parent / "behaviours").glob("*.py"))) if leaves is None else leaves
    return load_plan(path, own, LOOKUPS, find_mission=find_mission)


def export_and_import(
    plan: Plan, folder: Path, leaves: Mapping[str, type[Leaf]], edit: Callable[[str], str] = str
) -> tuple[ExportedTree, Path]:
    """Export a mission, import the file again, and return the export and the path of the new mission.

    ``edit`` changes the text of the file before the import.
    """
    folder.mkdir(parents=True, exist_ok=True)
    exported = export_mission(plan)
    xml = folder / "exported.xml"
    xml.write_text(edit(exported.text), encoding="utf-8")
    write_import(xml, folder, leaves)
    return exported, folder / f"{_file_of(plan, folder)}.yaml"


def _file_of(plan: Plan, folder: Path) -> str:
    """Return the stem of the file that holds the mission of ``plan`` after an import."""
    line = f"mission: {plan.mission}"
    found = (each.stem for each in folder.glob("*.yaml") if line in each.read_text().replace('"', "").splitlines())
    return next(found)


def tree_of(step: Step) -> object:
    """Return a step, with all below it, as data that is equal for equal trees in any notation."""
    arguments = {name: value_of(value) for name, value in step.arguments.items()}
    if step.kind == "parallel" and all(value.template is None for value in step.arguments.values()):
        settings = {name: value.constant for name, value in step.arguments.items()}
        arguments = {"decision": decide_parallel(len(step.children), settings)}
    cases = dict(zip(map(str, step.cases), map(tree_of, step.children), strict=False))
    return {
        "kind": step.kind,
        "name": step.name,
        "arguments": arguments,
        "as": step.output_variable,
        "binds": step.binds,
        "returns": {name: value_of(value) for name, value in step.returns.items()},
        "cases": cases,
        "children": [tree_of(child) for child in step.children[len(cases) :]],
    }


def value_of(value: Value) -> object:
    """Return a value: a constant, or the parts of its expressions."""
    if isinstance(value.template, Expression):
        return _parts(Template((value.template,)))
    return value.constant if value.template is None else _parts(value.template)


def _parts(template: Template) -> list[str]:
    return [part if isinstance(part, str) else _dump(part.text) for part in template.parts]


@cache
def _dump(text: str) -> str:
    """Return the syntax of an expression without its spaces and parentheses; 1.0 is 1."""
    tree = parse(text).tree
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and type(node.value) is float and node.value == int(node.value):
            node.value = int(node.value)
    return ast.dump(tree)
