"""A robot of three servos of both protocols, as virtual ones in this process, and the file that says so."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import radians
from pathlib import Path

import pytest

from drivers.servos.virtual.chain import VirtualServoBus
from drivers.servos.virtual.servo import VirtualServo
from drivers.virtual.patient_clock import PatientClock
from drivers.virtual.terminal import PseudoTerminal
from missions.plugins.setup.servo.connections import pause

FILE = """\
# Written by hand.
robot: three
arm:
  driver: dynamixel
  port: PORT
  at_end: AT_END
  joints:
    waist: {id: 1, limits: [-90 deg, 90 deg], speed: 120 deg/s}  # turns the rest
    elbow: {id: 2, zero: 10 deg, reverse: true, limits: [-60 deg, 60 deg], speed: 120 deg/s}
    wrist: {id: 3, model: XL430-W250, ticks: {init: 2048, min: 1024, max: 3072}, speed: 120 deg/s}
  groups:
    ax: [waist, elbow]
"""


def patient(patch: pytest.MonkeyPatch) -> PatientClock:
    """Return a clock for virtual servos, which ``mission servo`` has too: it misses none of their replies."""
    clock = PatientClock()
    patch.setattr("missions.plugins.setup.servo.connections.SystemClock", lambda: clock)
    for constant in ("missions.plugins.setup.servo.connections.REPLY_TIMEOUT", "drivers.servos.make.REPLY_TIMEOUT"):
        patch.setattr(constant, 0.1)  # it may be twice that a servo is held up
    return clock


def by_hand(patch: pytest.MonkeyPatch, clock: PatientClock, steps: Iterator[object]) -> None:
    """Have a hand take one of ``steps`` before each look of a command that watches; time waits until the last."""

    def looking() -> None:
        clock.heartbeat(steps)
        if next(steps, clock) is clock:
            clock.unregister(steps)
        pause()

    patch.setattr("missions.plugins.setup.servo.connections.pause", looking)


class Three:
    """The robot: ``waist`` and ``elbow`` are AX-12A, ``wrist`` is an XL430."""

    def __init__(self, path: Path, clock: PatientClock, *, at_end: str = "relax") -> None:
        self.waist = VirtualServo(1)
        self.elbow = VirtualServo(2, angle=radians(10))
        self.wrist = VirtualServo(3, model="XL430-W250")
        self.bus = VirtualServoBus([self.waist, self.elbow, self.wrist], 1_000_000)
        self.clock = clock
        self.terminal = PseudoTerminal("servos", self.bus, self.clock)
        self.path = path
        path.write_text(FILE.replace("PORT", self.terminal.path).replace("AT_END", at_end))


@contextmanager
def three(path: Path, clock: PatientClock, *, at_end: str = "relax") -> Iterator[Three]:
    """Write the robot file to ``path``, and run its servos meanwhile."""
    robot = Three(path, clock, at_end=at_end)
    robot.terminal.open()
    try:
        yield robot
    finally:
        robot.terminal.close()
