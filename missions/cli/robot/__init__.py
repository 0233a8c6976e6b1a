"""``mission robot``: a robot of one's own: looked at, checked, and taken for this computer's."""

import click

from missions.cli.robot.check import check
from missions.cli.robot.show import show
from missions.cli.robot.use import use


@click.group(epilog="Example: mission robot use turtlebot2_arm")
def command() -> None:
    """Look at a robot, check what is plugged in against its file, and make it this computer's own."""


for each in (show, check, use):
    command.add_command(each)
