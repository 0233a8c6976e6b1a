"""Who holds two actuators, as its wire shows it: the house's own keeper, with simulated wheels or servos."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from threading import RLock

from drivers.api import HeadPose, Pose2D
from drivers.base.reckoning import TwoWheels
from drivers.head.axis import ServoAxis
from drivers.sim.body import Body
from drivers.sim.servo import SERVO_SPEED, Shaft
from drivers.transport import guardian_wire
from drivers.transport.guardian import Keeper, Servos, Wheels
from drivers.virtual.plugged import Plugged


class VirtualKeeper(ABC):
    """A ``drivers.virtual.terminal.WireDevice``. Safe between threads. It has its power from no plug."""

    def __init__(self, baud: int) -> None:
        self.baud = baud
        self.keeper: Keeper | None = None
        self._boot = 0
        self._lock = RLock()

    @abstractmethod
    def hold(self) -> Wheels | Servos:
        """Take them in its hands, as after a start."""

    def feed(self, data: bytes, now: float) -> bytes:
        """Take lines; return the answers."""
        with self._lock:
            return self._started(now).feed(data, now)

    def poll(self, now: float) -> bytes:
        """Let time pass; it says nothing unasked."""
        with self._lock:
            self._started(now).poll(now)
            self.move(now)
        return b""

    @abstractmethod
    def move(self, now: float) -> None:
        """Let what it holds go on until ``now``."""

    def reset(self) -> None:
        """Have it begin anew."""
        with self._lock:
            self.keeper = None

    def _started(self, now: float) -> Keeper:
        if self.keeper is None:
            self._boot += 1
            self.keeper = Keeper(self.hold(), self._boot, now)
        return self.keeper


class VirtualCar(VirtualKeeper):
    """One whose motors turn the wheels of a ``body``: ``wheels.fastest`` at full power."""

    def __init__(self, body: Body, wheels: TwoWheels, *, baud: int = guardian_wire.BAUD) -> None:
        super().__init__(baud)
        self.body = body
        self.shares = (0.0, 0.0)
        self._wheels = wheels

    def hold(self) -> Wheels:
        """Take both motors."""
        return Wheels(self._turn)

    def move(self, now: float) -> None:
        """Turn the wheels: those of the body forget what they were told, and these do not."""
        velocity = self._wheels.velocity(*(share * self._wheels.fastest for share in self.shares))
        self.body.command(velocity.linear, velocity.angular, now)

    def pose(self, now: float) -> Pose2D:
        """Where it really is at time ``now``."""
        with self._lock:
            return self.body.advance(now)

    def _turn(self, left: float, right: float) -> None:
        self.shares = (left, right)


class VirtualServos(VirtualKeeper):
    """One that has two servos, which stand at ``standing`` (degrees).

    It knows where where it is ``warm``: somebody before us has sent them there, and it has had power ever since.
    ``widest`` is the widest step (degrees) that a servo was sent, from where it was sent before, or stood.
    """

    def __init__(self, standing: Sequence[float], *, baud: int = guardian_wire.BAUD, warm: bool = True) -> None:
        super().__init__(baud)
        self.warm = warm
        self.widest = 0.0
        self.sent = 0
        self._shafts = [Shaft(each, each, SERVO_SPEED) for each in standing]

    def hold(self) -> Servos:
        """Take both servos."""
        first, second = (round(shaft.goal) if self.warm else None for shaft in self._shafts)
        return Servos(self._pulse, (first, second))

    def move(self, now: float) -> None:
        """Let the shafts turn."""
        for shaft in self._shafts:
            shaft.advance(now)

    def angle(self, number: int, now: float) -> float:
        """Where a servo stands, in degrees."""
        with self._lock:
            return self._shafts[number].advance(now)

    def reset(self) -> None:
        """Have it begin anew: it knows nothing of its servos any more."""
        with self._lock:
            self.warm = False
            super().reset()

    def _pulse(self, number: int, degree: int) -> None:
        self.sent += 1
        shaft = self._shafts[number]
        self.widest = max(self.widest, abs(degree - shaft.goal))
        shaft.goal = float(degree)


def plugged_servos(device: VirtualServos, pan: ServoAxis, tilt: ServoAxis, wire: str) -> Plugged:
    """Return two servos that a guardian holds; the state is their degrees."""

    def looks(time: float) -> HeadPose:
        return HeadPose(pan.to_radians(device.angle(0, time)), tilt.to_radians(device.angle(1, time)))

    return Plugged(device, wire, looks=looks, state=lambda now: [device.angle(index, now) for index in range(2)])
