"""``mission schema``: JSON Schemas for editors with YAML support."""

import json
from pathlib import Path

import click

from config.file_io import save_file
from missions.cli.option_declarations import behaviours_option
from missions.cli.options import folder_behaviour_files
from missions.cli.outputs import report_write_errors
from missions.library.drivers import DriverTable
from missions.library.vocabulary import load_leaves
from missions.plugins.schema.files import FILE_KINDS, file_schema
from missions.plugins.schema.mission import mission_schema, shipped_things
from missions.plugins.schema.robots import robot_reference
from missions.trees import drawing

TREE_KIND = "tree"
"""Name under which `mission schema` writes the schema of a drawn tree in JSON, which is not a kind of file."""


@click.command(epilog="Example: mission schema -o mission.schema.json")
@click.argument("kind", type=click.Choice(["missions", *FILE_KINDS, TREE_KIND]), default="missions", metavar="[KIND]")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Write to this file."
)
@click.option("--reference", is_flag=True, help="For robots: write all keys of all drivers, as Markdown.")
@behaviours_option
def command(kind: str, output: Path | None, files: tuple[Path, ...], *, reference: bool) -> None:
    """Write the JSON Schema of missions, with which an editor completes, explains and checks them.

    Another KIND writes the schema of tests, robots, worlds, gestures, gaits, moves, controllers or objects, or of the
    tree that `mission show --format json` writes. In VS Code, install the YAML extension, run `mission schema -o
    mission.schema.json`, and begin a mission in that folder with the line

    # yaml-language-server: $schema=mission.schema.json
    """
    if reference:
        if kind != "robots":
            raise click.UsageError("--reference is for robots: mission schema robots --reference")
        _write(robot_reference(DriverTable()), output)
        return
    if kind == TREE_KIND:
        schema = drawing.schema()
    elif kind != "missions":
        schema = file_schema(kind)
    else:
        schema = mission_schema(load_leaves(folder_behaviour_files(files), files), shipped_things())
    _write(json.dumps(schema, indent=1, ensure_ascii=False), output)


def _write(text: str, output: Path | None) -> None:
    """Write a text to a file, or print it."""
    if output is None:
        click.echo(text)
        return
    with report_write_errors(output, "-o"):
        save_file(output, f"{text}\n")
    click.echo(f"wrote {output}", err=True)
