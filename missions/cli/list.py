"""``mission list``: what there is to run, and what to run it on."""

from collections.abc import Callable, Iterator
from pathlib import Path

import click

from config.controller import load_controller
from config.gesture import load_gesture
from config.library import shipped
from config.object import load_object
from config.robot import load_robot
from config.world import load_world
from missions.cli.console import echo
from missions.library import load_mission, shipped_missions

KINDS = ("missions", "robots", "worlds", "gestures", "controllers", "objects")


@click.command()
@click.argument("kind", required=False, type=click.Choice(KINDS))
def command(kind: str | None) -> None:
    """List what ships with MissionTree, by name, with a line on each."""
    for each in KINDS if kind is None else (kind,):
        echo(each, "bold")
        for name, summary in _entries(each):
            click.echo(f"  {name:<28} {summary}")


def _entries(kind: str) -> Iterator[tuple[str, str]]:
    if kind == "missions":
        for name in shipped_missions():
            yield name, load_mission(name).summary
        return
    for name, path in shipped(kind).items():
        yield name, _SUMMARIES[kind](path)


_SUMMARIES: dict[str, Callable[[Path], str]] = {
    "robots": lambda path: load_robot(path).summary,
    "worlds": lambda path: load_world(path).summary,
    "gestures": lambda path: load_gesture(path).summary,
    "controllers": lambda path: load_controller(path).summary,
    "objects": lambda path: load_object(path).summary,
}
