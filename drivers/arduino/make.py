"""From the keys of a robot file to the driver of a Rodney head."""

from drivers.api import Head
from drivers.api.driver import Site
from drivers.arduino.board import Board
from drivers.arduino.declared import ArduinoKeys, SecondKeys
from drivers.arduino.driver import ArduinoHead
from drivers.head.axis import servo_axis
from drivers.head.keys import TwoServoKeys
from drivers.head.memory import Memory
from drivers.transport.link import Link

CURE = "flash docs/keeper_head/keeper_head.ino; look at its power and its cable"


def make(keys: ArduinoKeys, site: Site) -> Head:
    """Return the driver; where its servos were left is kept, but for a virtual one."""
    link = Link(site.part, site.port, keys.baud, report=site.report)
    remembered = None if site.state is None else Memory(site.state, site.port)
    if keys.protocol == "lines":
        from drivers.head.guardian_head import KeeperHead  # noqa: PLC0415 - few boards have that sketch

        return KeeperHead(
            link,
            site.clock,
            pan=servo_axis(keys.pan),
            tilt=servo_axis(keys.tilt),
            speed=keys.speed,
            acceleration=keys.acceleration,
            away=keys.away,
            report=site.report,
            name=site.part,
            remembered=remembered,
            cure=CURE,
        )
    board = Board(
        link,
        site.clock,
        boot_delay=0.0 if site.virtual else keys.boot,
        report=site.report,
        away=keys.away,
        remembered=remembered,
    )
    return _on(board, keys, site)


def second(keys: SecondKeys, site: Site) -> ArduinoHead:
    """Return the driver of a second pan/tilt on the board of the robot's head."""
    first: ArduinoHead = site.parts["head"]
    return _on(first.board, keys, site)


def _on(board: Board, keys: TwoServoKeys, site: Site) -> ArduinoHead:
    return ArduinoHead(
        board,
        site.clock,
        pan=servo_axis(keys.pan),
        tilt=servo_axis(keys.tilt),
        speed=keys.speed,
        acceleration=keys.acceleration,
        name=site.part,
    )
