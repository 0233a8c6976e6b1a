"""The rover: lines of text over a serial port.

It takes ``v 250 -100``: millimetres and milliradians a second, valid for 0.3 s; ``b 440 200``: a tone in hertz and
milliseconds. Fifty times a second it says ``o 1200 -35 1570 250 -100``: where it is, its heading, how it moves.
"""

from drivers.api import BaseState, Pose2D, Tune, Velocity
from drivers.api.driver import Site
from drivers.base.arbitrated import settings_of
from drivers.base.diff_drive import DiffDriveBase, DiffDriveProtocol, Parsed
from drivers.transport.link import SerialLink
from sample_robot.declared import RoverKeys


def make(keys: RoverKeys, site: Site) -> DiffDriveBase:
    """Return the driver."""
    link = SerialLink("base", site.port, keys.baud, report=site.report)
    return DiffDriveBase(link, site.clock, RoverProtocol(horn=keys.horn), **settings_of(keys, site))


class RoverProtocol(DiffDriveProtocol):
    """Protocol of the rover."""

    model = "a rover"
    noun = "rover"

    def __init__(self, *, horn: bool) -> None:
        self.sounds = self if horn else None
        self._begun = b""

    def restart(self) -> None:
        self._begun = b""

    def greet(self) -> bytes:
        return b""  # it reports by itself

    def parse(self, data: bytes, now: float) -> Parsed:
        del now
        *lines, self._begun = (self._begun + data).split(b"\n")
        parsed = Parsed()
        for line in lines:
            word, *figures = line.split() or [b""]
            if word == b"o" and len(figures) == 5:
                x, y, heading, linear, angular = (int(figure) / 1000 for figure in figures)
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
