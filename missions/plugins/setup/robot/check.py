"""``mission robot check``: compare a robot file with the connected devices, at rest."""

from pathlib import Path

import click

from config.library import OWN_ROBOT
from drivers.clock import SystemClock
from drivers.finding.machine import HostMachine
from missions.cli.keys import interruptible
from missions.cli.names import ROBOT
from missions.cli.origin import robot_file
from missions.cli.root import FAILURE, SUCCESS
from missions.library.drivers import load_robot
from missions.plugins.setup.checkup import check_robot
from missions.plugins.setup.ports import root_option


@click.command(epilog="Example: mission robot check turtlebot2_arm")
@click.argument("name", required=False, default=OWN_ROBOT, type=ROBOT)
@click.option("--reset", is_flag=True, help="Also probe Arduinos, which resets them, and they may move.")
@root_option
def check(name: str, reset: bool, root: Path) -> int:
    """Check a robot at rest: its file, its ports, and the replies of its devices.

    Without NAME, this computer's own robot. `mission doctor` checks the computer too. Exit code 1: something is wrong.
    """
    config, code = load_robot(robot_file(name)), SUCCESS
    click.echo(f"{config.name}  {config.path}")
    with interruptible():
        for each in check_robot(config, name, HostMachine(root), SystemClock(), ports={}, resets=reset):
            finding = each.finding
            code = FAILURE if finding.verdict == "wrong" else code
            click.echo(f"{finding.verdict:<8} {each.part} {finding.about}: {finding.message}")
            if finding.fix and finding.verdict != "ok":
                click.echo(f"         try: {finding.fix}")
    return code
