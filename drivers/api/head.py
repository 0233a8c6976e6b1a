"""Protocol of a head that pans and tilts the camera."""

from collections.abc import Mapping
from math import sqrt
from typing import Protocol

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import command, fixed
from drivers.api.measures import Angle


@dataclass(frozen=True, slots=True)
class HeadPose:
    """Direction of the head in radians: ``pan`` about z, positive left; ``tilt`` about y, positive down."""

    pan: Angle
    tilt: Angle

    def figures(self) -> Mapping[str, float]:
        """Return the angles that displays show, by name, in radians."""
        return {"pan": self.pan, "tilt": self.tilt}


HEAD_ACCELERATION = 7.0
"""Default acceleration of a head in rad/s^2 (400 degrees/s^2)."""


@dataclass(frozen=True, slots=True)
class HeadLimits:
    """Range (radians), maximum speed (rad/s) and acceleration (rad/s^2) of a head; the last two hold for each axis.

    ``measured`` is False for servos that report nothing: the pose is computed from the setpoints.
    """

    pan: tuple[float, float]
    tilt: tuple[float, float]
    speed: float
    acceleration: float = HEAD_ACCELERATION
    measured: bool = True

    def clamp(self, pose: HeadPose) -> HeadPose:
        """Return the nearest pose within the limits."""
        return HeadPose(
            pan=min(max(pose.pan, self.pan[0]), self.pan[1]), tilt=min(max(pose.tilt, self.tilt[0]), self.tilt[1])
        )

    def time_for(self, angle: float) -> float:
        """Return the seconds for which an axis turns by ``angle`` (radians), from rest to rest."""
        way = abs(angle)
        if way * self.acceleration < self.speed**2:  # it brakes before it reaches its maximum speed
            return 2 * sqrt(way / self.acceleration)
        return way / self.speed + self.speed / self.acceleration


class Head(Device, Protocol):
    """A head that pans and tilts a camera."""

    @property
    @fixed
    def limits(self) -> HeadLimits:
        """Range, maximum speed and acceleration of the head."""
        ...

    @command("after", moves=True, default_reply=lambda head, target: head.limits.clamp(target))
    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping. Raises BadRequest if not finite."""
        ...

    def pose(self) -> Reading[HeadPose]:
        """Current direction of the head: measured if the servos report, else computed from the setpoints."""
        ...

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Direction of the head at a past time, interpolated; None if unknown."""
        ...

    @command("before")
    def stop(self) -> None:
        """Brake the head within its acceleration limit, and hold. Safe from any state; never raises when offline."""
        ...
