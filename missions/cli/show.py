"""``mission show``: the tree as a picture in text, or for Graphviz."""

from collections.abc import Iterator
from pathlib import Path

import click
from py_trees import display
from py_trees.behaviour import Behaviour

from behaviours.robot import Robot
from behaviours.run import Run
from drivers.clock import ManualClock
from missions.cli.options import behaviours_option, params_option
from missions.executive.build import build
from missions.language.plan import Step
from missions.library import load_mission
from missions.vocabulary import vocabulary


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
@behaviours_option
def command(name: str, form: str, params: dict[str, str], files: tuple[Path, ...]) -> None:
    """Draw the tree of a mission (a name or a file)."""
    plan = load_mission(name, params=params, leaves=vocabulary(files))
    root = build(plan, Run(ManualClock()), lambda leaf: Robot())  # noqa: ARG005 - nothing here is ticked
    for node, step in zip(_downwards(root), plan.tree.walk(), strict=True):
        node.name = _label(step)
        if form == "dot":
            # A colon in a name would be a port to Graphviz; this sign looks the same.
            node.name = node.name.replace(":", "\N{RATIO}")
    if form == "dot":
        click.echo(_dot(root))
    elif form == "ascii":
        click.echo(display.ascii_tree(root), nl=False)
    else:
        click.echo(display.unicode_tree(root), nl=False)


def _downwards(node: Behaviour) -> Iterator[Behaviour]:
    """Yield a node and all below it, in the order of the file."""
    yield node
    for child in node.children:
        yield from _downwards(child)


def _label(step: Step) -> str:
    """Return what a person reads in the picture: the name it was given, else what the file says."""
    said = f"{step.kind}: {step.text}" if step.text else step.kind
    return said if step.name == step.kind or step.text else f"{step.kind}: {step.name}"


def _dot(root: Behaviour) -> str:
    graph = display.dot_tree(root)
    graph.set_name("mission")
    return str(graph.to_string())
