"""``mission servo``: Dynamixel and Feetech servos by hand, from the first scan to a recorded movement."""

import click

from missions.plugins.setup.servo.calibrate import calibrate
from missions.plugins.setup.servo.change import set_baud, set_id, set_register
from missions.plugins.setup.servo.drive import move, reboot, recover, torque
from missions.plugins.setup.servo.home import home
from missions.plugins.setup.servo.importing import import_joints
from missions.plugins.setup.servo.info import info
from missions.plugins.setup.servo.mirror import mirror
from missions.plugins.setup.servo.monitor import monitor
from missions.plugins.setup.servo.playing import play
from missions.plugins.setup.servo.recording import record
from missions.plugins.setup.servo.scan import scan


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
