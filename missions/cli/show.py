"""``mission show``: the tree as a picture in text, or for Graphviz."""

import click
from py_trees import display

from behaviours.robot import Robot
from behaviours.run import Run
from drivers.clock import ManualClock
from missions.cli.options import params_option
from missions.executive.build import build
from missions.library import load_mission


@click.command()
@click.argument("name", metavar="MISSION")
@click.option(
    "--format",
    "form",
    type=click.Choice(["unicode", "ascii", "dot"]),
    default="unicode",
    show_default=True,
    help="How to draw it.",
)
@params_option
def command(name: str, form: str, params: dict[str, str]) -> None:
    """Draw the tree of a mission (a name or a file)."""
    plan = load_mission(name, params=params)
    root = build(plan, Run(ManualClock()), lambda leaf: Robot())  # noqa: ARG005 - nothing here is ticked
    for node in root.iterate():
        node.name = node.name if node.name == node.kind else f"{node.kind}: {node.name}"  # type: ignore[attr-defined]
    if form == "dot":
        click.echo(display.dot_tree(root).to_string())
    elif form == "ascii":
        click.echo(display.ascii_tree(root), nl=False)
    else:
        click.echo(display.unicode_tree(root), nl=False)
