"""Who holds two actuators, as its wire shows it: the house's own keeper, with simulated wheels or servos."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from threading import RLock

from drivers.api import HeadPose, Pose2D
from drivers.base.reckoning import TwoWheels
from drivers.head.axis import ServoAxis
from drivers.sim.base_body import BaseBody
from drivers.sim.servo import SERVO_SPEED, Shaft
from drivers.transport import guardian_wire
from drivers.transport.guardian import ActuatorGuardian, GuardianServos, GuardianWheels
from drivers.virtual.device import VirtualDevice


class VirtualGuardian(ABC):
    """A ``drivers.virtual.terminal.WireDevice``. Safe between threads. It has its power from no plug."""

    def __init__(self, baud: int) -> None:
        self.baud = baud
        self.guardian: ActuatorGuardian | None = None
        self._boot = 0
        self._lock = RLock()

    @abstractmethod
    def make_actuators(self) -> GuardianWheels | GuardianServos:
        """Take them in its hands, as after a start."""

    def feed(self, data: bytes, now: float) -> bytes:
        """Take lines; return the answers."""
        with self._lock:
            return self._get_guardian(now).feed(data, now)

    def poll(self, now: float) -> bytes:
        """Let time pass; it says nothing unasked."""
        with self._lock:
            self._get_guardian(now).poll(now)
            self.advance(now)
        return b""

    @abstractmethod
    def advance(self, now: float) -> None:
        """Let what it holds go on until ``now``."""

    def reset(self) -> None:
        """Have it begin anew."""
        with self._lock:
            self.guardian = None

    def _get_guardian(self, now: float) -> ActuatorGuardian:
        if self.guardian is None:
            self._boot += 1
            self.guardian = ActuatorGuardian(self.make_actuators(), self._boot, now)
        return self.guardian


class VirtualCar(VirtualGuardian):
    """One whose motors turn the wheels of a ``body``: ``wheels.fastest`` at full power."""

    def __init__(self, body: BaseBody, wheels: TwoWheels, *, baud: int = guardian_wire.BAUD) -> None:
        super().__init__(baud)
        self.body = body
        self.shares = (0.0, 0.0)
        self._wheels = wheels

    def make_actuators(self) -> GuardianWheels:
        """Take both motors."""
        return GuardianWheels(self._turn)

    def advance(self, now: float) -> None:
        """Turn the wheels: those of the body forget what they were told, and these do not."""
        velocity = self._wheels.velocity(*(share * self._wheels.fastest for share in self.shares))
        self.body.command(velocity.linear, velocity.angular, now)

    def pose(self, now: float) -> Pose2D:
        """Where it really is at time ``now``."""
        with self._lock:
            return self.body.advance(now)

    def _turn(self, left: float, right: float) -> None:
        self.shares = (left, right)


class VirtualServos(VirtualGuardian):
    """One that has two servos, which stand at ``standing`` (degrees).

    It knows where where it is ``knows_angles``: somebody before us has sent them there, and it has had power ever since.
    ``max_step`` is the widest step (degrees) that a servo was sent, from where it was sent before, or stood.
    """

    def __init__(self, angles: Sequence[float], *, baud: int = guardian_wire.BAUD, knows_angles: bool = True) -> None:
        super().__init__(baud)
        self.knows_angles = knows_angles
        self.max_step = 0.0
        self.pulse_count = 0
        self._shafts = [Shaft(each, each, SERVO_SPEED) for each in angles]

    def make_actuators(self) -> GuardianServos:
        """Take both servos."""
        first, second = (round(shaft.goal) if self.knows_angles else None for shaft in self._shafts)
        return GuardianServos(self._pulse, (first, second))

    def advance(self, now: float) -> None:
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
            self.knows_angles = False
            super().reset()

    def _pulse(self, number: int, degree: int) -> None:
        self.pulse_count += 1
        shaft = self._shafts[number]
        self.max_step = max(self.max_step, abs(degree - shaft.goal))
        shaft.goal = float(degree)


def make_virtual_servos(device: VirtualServos, pan: ServoAxis, tilt: ServoAxis, wire: str) -> VirtualDevice:
    """Return two servos that a guardian holds; the state is their degrees."""

    def looks(time: float) -> HeadPose:
        return HeadPose(pan.to_radians(device.angle(0, time)), tilt.to_radians(device.angle(1, time)))

    return VirtualDevice(
        device, wire, head_pose=looks, state=lambda now: [device.angle(index, now) for index in range(2)]
    )
