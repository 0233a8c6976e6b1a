"""``mission servo``: Dynamixel and Feetech servos by hand, from the first scan to a recorded movement."""

import click

from missions.cli.servo.calibrate import calibrate
from missions.cli.servo.change import set_baud, set_id, set_register
from missions.cli.servo.drive import move, reboot, recover, torque
from missions.cli.servo.home import home
from missions.cli.servo.importing import import_joints
from missions.cli.servo.info import info
from missions.cli.servo.mirror import mirror
from missions.cli.servo.monitor import monitor
from missions.cli.servo.playing import play
from missions.cli.servo.recording import record
from missions.cli.servo.scan import scan


@click.group(epilog="Example: mission servo scan --port /dev/ttyUSB0")
def command() -> None:
    """Dynamixel and Feetech servos by hand, from the first scan to a recorded movement.

    Hardware is touched only where --robot or --port names it; without them all is simulated.
    """


for each in (
    *(scan, info, monitor, set_register, set_id, set_baud, torque, move, reboot, recover),
    *(calibrate, home, import_joints, record, play, mirror),
):
    command.add_command(each)
