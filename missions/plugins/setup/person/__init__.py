"""``mission person``: the people whose faces a robot knows."""

import click

from missions.cli.commands import LazyGroup
from missions.plugins.setup.person.add import add, list_people, remove


@click.group("person", cls=LazyGroup, epilog="Example: mission person list")
def command() -> None:
    """Add, list and remove the people whose faces a robot knows.

    Their pictures stay on this computer, where only you can read them.
    """


for each in (add, list_people, remove):
    command.add_command(each)
