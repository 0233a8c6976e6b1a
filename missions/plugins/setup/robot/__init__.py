"""``mission robot``: a robot of one's own: made, looked at, checked, and taken for this computer's."""

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
    """Make a robot file by answering questions; look at it, check it, and make it this computer's own."""


for each in (new, show, check, use):
    command.add_command(each)
