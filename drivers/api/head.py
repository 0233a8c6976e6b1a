"""What a behaviour sees of a head that pans and tilts a camera."""

from collections.abc import Mapping
from math import sqrt
from typing import Protocol

from drivers.api.device import Device, Reading
from drivers.api.fast_dataclass import dataclass
from drivers.api.marks import command, fixed
from drivers.api.measures import Angle


@dataclass(frozen=True, slots=True)
class HeadPose:
    """Where the head looks, in radians: ``pan`` about z, positive left; ``tilt`` about y, positive down."""

    pan: Angle
    tilt: Angle

    def figures(self) -> Mapping[str, float]:
        """Return what is shown of it, in radians."""
        return {"pan": self.pan, "tilt": self.tilt}


HEAD_ACCELERATION = 7.0
"""rad/s^2 (400 degrees/s^2): how hard a head speeds up and brakes unless the robot file says otherwise."""


@dataclass(frozen=True, slots=True)
class HeadLimits:
    """How far the head turns (radians), how fast (rad/s), and how hard it speeds up and brakes (rad/s^2); both axes.

    ``measured`` is False for servos that report nothing: the pose is computed from what they were sent.
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
        """Return the seconds that an axis needs for a turn by ``angle`` (radians), from rest to rest."""
        way = abs(angle)
        if way * self.acceleration < self.speed**2:  # it brakes before it has come to its full speed
            return 2 * sqrt(way / self.acceleration)
        return way / self.speed + self.speed / self.acceleration


class Head(Device, Protocol):
    """A head that pans and tilts a camera."""

    @property
    @fixed
    def limits(self) -> HeadLimits:
        """How far and how fast it turns."""
        ...

    @command("after", moves=True, default_reply=lambda head, target: head.limits.clamp(target))
    def look(self, target: HeadPose) -> HeadPose:
        """Start moving to ``target``; return the pose accepted after clamping. Raises BadRequest if not finite."""
        ...

    def pose(self) -> Reading[HeadPose]:
        """Where the head looks now: measured where the servos tell, else computed from what they were sent."""
        ...

    def pose_at(self, stamp: float) -> HeadPose | None:
        """Where the head looked at a past time, interpolated; None when that is not known."""
        ...

    @command("before")
    def stop(self) -> None:
        """Brake, within its acceleration, and hold. Safe from any state, more than once; never raises when offline."""
        ...
