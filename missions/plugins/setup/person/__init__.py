"""``mission person``: the people whom a robot knows by their faces."""

import click

from missions.cli.commands import LazyGroup
from missions.plugins.setup.person.add import add, list_people, remove


@click.group("person", cls=LazyGroup, epilog="Example: mission person list")
def command() -> None:
    """Let a robot know people by their faces, list them, and forget them.

    Their pictures stay on this machine, where only you can read them.
    """


for each in (add, list_people, remove):
    command.add_command(each)
