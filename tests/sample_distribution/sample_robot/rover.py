"""Driver of the rover: lines of text over a serial port.

Its commands are ``v 250 -100``: millimetres and milliradians per second, valid for 0.3 s; ``b 440 200``: a tone in
hertz and milliseconds. Fifty times per second it reports ``o 1200 -35 1570 250 -100``: position, heading and velocity.
"""

from drivers.api import BaseState, Pose2D, Tune, Velocity
from drivers.api.driver import DriverContext
from drivers.base.arbitrated import settings_of
from drivers.base.diff_drive import DiffDriveBase, DiffDriveProtocol, ParsedReports
from drivers.transport.link import SerialLink
from sample_robot.declared import RoverKeys


def make(keys: RoverKeys, context: DriverContext) -> DiffDriveBase:
    """Return the driver."""
    link = SerialLink("base", context.port, keys.baud, report=context.report)
    return DiffDriveBase(link, context.clock, RoverProtocol(horn=keys.horn), **settings_of(keys, context))


class RoverProtocol(DiffDriveProtocol):
    """Protocol of the rover."""

    model = "a rover"
    noun = "rover"

    def __init__(self, *, horn: bool) -> None:
        self.sounds = self if horn else None
        self._partial_line = b""

    def restart(self) -> None:
        self._partial_line = b""

    def greet(self) -> bytes:
        return b""  # it reports by itself

    def parse(self, data: bytes, now: float) -> ParsedReports:
        del now
        *lines, self._partial_line = (self._partial_line + data).split(b"\n")
        parsed = ParsedReports()
        for line in lines:
            word, *values = line.split() or [b""]
            if word == b"o" and len(values) == 5:
                x, y, heading, linear, angular = (int(value) / 1000 for value in values)
                pose, velocity = Pose2D(x, y, heading), Velocity(linear, angular)
                parsed.states.append(BaseState(pose, velocity, battery_voltage=12.0, battery_percent=80.0))
        return parsed

    def drive(self, velocity: Velocity, now: float) -> bytes:
        del now
        return b"v %d %d\n" % (round(1000 * velocity.linear), round(1000 * velocity.angular))

    def play(self, tune: Tune) -> bytes:
        del tune  # it has one tone for all
        return self.tone(440.0, 0.2)

    def tone(self, frequency: float, seconds: float) -> bytes:
        return b"b %d %d\n" % (frequency, 1000 * seconds)
