"""What is felt of a robot's attitude: by an inertial measurement unit (IMU) in its trunk."""

from collections.abc import Mapping
from typing import Protocol

from drivers.api.device import Device, Reading
from drivers.api.quick import dataclass


@dataclass(frozen=True, slots=True)
class Attitude:
    """How the robot leans, and how that changes; axes of REP 103, which are the robot's own.

    ``roll`` to its right and ``pitch`` ahead are above 0 (rad), ``yaw`` to its left: it drifts, and begins anywhere.
    ``rates`` (rad/s) are those about x, y, z; ``forces`` (m/s2) the acceleration along them, with gravity's 9.81 up.
    """

    roll: float
    pitch: float
    yaw: float
    rates: tuple[float, float, float]
    forces: tuple[float, float, float]

    def figures(self) -> Mapping[str, float]:
        """Return what is shown of it, in radians."""
        return {"roll": self.roll, "pitch": self.pitch}


class Imu(Device, Protocol):
    """An IMU; its part of the robot is ``imu``."""

    def attitude(self) -> Reading[Attitude]:
        """Return the newest attitude; stale after 0.1 s without another."""
        ...
