"""``mission robot``: create, show, check and select a robot file."""

import click

from missions.cli.commands import LazyGroup
from missions.plugins.setup.robot.check import check
from missions.plugins.setup.robot.new import new, use
from missions.plugins.setup.robot.show import show


@click.group(
    "robot",
    cls=LazyGroup,
    epilog="Example: mission robot new",
)
def command() -> None:
    """Create a robot file by answering questions; show it, check it, and make it this computer's own."""


for each in (new, show, check, use):
    command.add_command(each)
