"""Virtual actuator guardian at wire level: MissionTree's own guardian, with simulated wheels or servos."""

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
    """Virtual guardian: a ``drivers.virtual.terminal.WireDevice``. Thread-safe.

    It keeps running while it is unplugged.
    """

    def __init__(self, baud: int) -> None:
        self.baud = baud
        self.guardian: ActuatorGuardian | None = None
        self._boot = 0
        self._lock = RLock()

    @abstractmethod
    def make_actuators(self) -> GuardianWheels | GuardianServos:
        """Return the guardian's simulated actuators, as they are after a start of the guardian."""

    def feed(self, data: bytes, now: float) -> bytes:
        """Handle lines; return the replies."""
        with self._lock:
            return self._get_guardian(now).feed(data, now)

    def poll(self, now: float) -> bytes:
        """Advance to time ``now``; return no bytes, since a guardian only replies."""
        with self._lock:
            self._get_guardian(now).poll(now)
            self.advance(now)
        return b""

    @abstractmethod
    def advance(self, now: float) -> None:
        """Advance the simulated actuators to time ``now``."""

    def reset(self) -> None:
        """Restart the guardian."""
        with self._lock:
            self.guardian = None

    def _get_guardian(self, now: float) -> ActuatorGuardian:
        if self.guardian is None:
            self._boot += 1
            self.guardian = ActuatorGuardian(self.make_actuators(), self._boot, now)
        return self.guardian


class VirtualCar(VirtualGuardian):
    """Virtual guardian whose motors turn the wheels of a simulated ``body``.

    ``wheels`` convert wheel speeds to the velocity of the body; their maximum speed is reached at full power.
    """

    def __init__(self, body: BaseBody, wheels: TwoWheels, *, baud: int = guardian_wire.BAUD) -> None:
        super().__init__(baud)
        self.body = body
        self.shares = (0.0, 0.0)
        self._wheels = wheels

    def make_actuators(self) -> GuardianWheels:
        return GuardianWheels(self._turn)

    def advance(self, now: float) -> None:
        """Send the current power of the motors to the simulated body, which would otherwise stop after a while."""
        velocity = self._wheels.velocity(*(share * self._wheels.fastest for share in self.shares))
        self.body.command(velocity.linear, velocity.angular, now)

    def pose(self, now: float) -> Pose2D:
        """Return the true pose of the car at time ``now``."""
        with self._lock:
            return self.body.advance(now)

    def _turn(self, left: float, right: float) -> None:
        self.shares = (left, right)


class VirtualServos(VirtualGuardian):
    """Virtual guardian with two servos, initially at ``angles`` (degrees).

    With ``knows_angles`` an earlier program has set the servos, so the guardian knows their angles. ``max_step`` is the
    largest step between two setpoints of a servo so far, in degrees; the first step is from the initial angle.
    """

    def __init__(self, angles: Sequence[float], *, baud: int = guardian_wire.BAUD, knows_angles: bool = True) -> None:
        super().__init__(baud)
        self.knows_angles = knows_angles
        self.max_step = 0.0
        self.pulse_count = 0
        self._shafts = [Shaft(each, each, SERVO_SPEED) for each in angles]

    def make_actuators(self) -> GuardianServos:
        first, second = (round(shaft.goal) if self.knows_angles else None for shaft in self._shafts)
        return GuardianServos(self._pulse, (first, second))

    def advance(self, now: float) -> None:
        for shaft in self._shafts:
            shaft.advance(now)

    def angle(self, number: int, now: float) -> float:
        """Return the angle of a servo, in degrees."""
        with self._lock:
            return self._shafts[number].advance(now)

    def reset(self) -> None:
        """Restart the guardian, which forgets the angles of its servos."""
        with self._lock:
            self.knows_angles = False
            super().reset()

    def _pulse(self, number: int, degree: int) -> None:
        self.pulse_count += 1
        shaft = self._shafts[number]
        self.max_step = max(self.max_step, abs(degree - shaft.goal))
        shaft.goal = float(degree)


def make_virtual_servos(device: VirtualServos, pan: ServoAxis, tilt: ServoAxis, wire: str) -> VirtualDevice:
    """Return a virtual head of two servos with the port name ``wire``; its state is their angles in degrees."""

    def looks(time: float) -> HeadPose:
        return HeadPose(pan.to_radians(device.angle(0, time)), tilt.to_radians(device.angle(1, time)))

    return VirtualDevice(
        device, wire, head_pose=looks, state=lambda now: [device.angle(index, now) for index in range(2)]
    )
