"""``mission servo``: commands for Dynamixel and Feetech servos."""

import click

from missions.cli.commands import LazyGroup
from missions.plugins.setup.servo.calibrate import calibrate
from missions.plugins.setup.servo.home import home
from missions.plugins.setup.servo.joint_commands import move, torque
from missions.plugins.setup.servo.joint_import import import_joints
from missions.plugins.setup.servo.mirror import mirror
from missions.plugins.setup.servo.movement_playback import play
from missions.plugins.setup.servo.movement_recording import record
from missions.plugins.setup.servo.registers import info, set_register
from missions.plugins.setup.servo.scan import scan


@click.group("servo", cls=LazyGroup, epilog="Example: mission servo scan --port /dev/ttyUSB0")
def command() -> None:
    """Find, set up, move and record Dynamixel and Feetech servos.

    Hardware is used only if you name it with --robot or --port; otherwise all is simulated.
    """


for each in (
    *(scan, info, set_register, torque, move),
    *(calibrate, home, import_joints, record, play, mirror),
):
    command.add_command(each)
