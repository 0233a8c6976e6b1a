"""A program that drives a car as fast as it may until somebody ends it; what it holds is JSON, as its argument."""

import json
import sys
from contextlib import suppress
from threading import Event

from drivers.api import Velocity
from drivers.base.diff_drive import DiffDriveBase
from drivers.clock import SystemClock
from drivers.errors import DriverError
from drivers.pi_car.driver import GuardianProtocol
from drivers.pi_car.make import GuardianLauncher
from drivers.transport.link import SerialLink

if __name__ == "__main__":
    link = SerialLink("base", "the guardian", 57_600, opener=GuardianLauncher(json.loads(sys.argv[1]), sys.argv[2:]))
    base = DiffDriveBase(link, SystemClock(), GuardianProtocol(0.13, 0.5))
    base.open()
    while True:
        with suppress(DriverError):
            base.drive(Velocity(0.4, 0.0))
        Event().wait(0.05)
