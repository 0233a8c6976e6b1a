"""``mission robot udev``: udev rules that name the serial ports of a TurtleBot."""

from importlib.resources import files

import click

INSTALL_HINT = """to install them:
  mission robot udev | sudo tee /etc/udev/rules.d/99-missiontree.rules
  sudo udevadm control --reload
then plug the devices in again: `ls -l /dev/kobuki /dev/rplidar` shows the names"""


@click.command(epilog="Example: mission robot udev")
def udev() -> None:
    """Print udev rules with names, permissions and speed of a TurtleBot's serial ports, and how to install them."""
    click.echo((files("drivers") / "99-missiontree.rules").read_text(encoding="utf-8"), nl=False)
    click.echo(INSTALL_HINT, err=True)
