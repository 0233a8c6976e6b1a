"""Pose of a camera and projection of the world onto its picture, by the pinhole model.

Camera axes are those of computer vision: X to the right of the picture, Y down, Z along the optical axis. Pixel
coordinates are those of pixel centres, so the optical axis meets a picture of width w at x = (w - 1) / 2.
"""

from dataclasses import dataclass
from math import atan, cos, hypot, sin, tan

from drivers.api import Pose2D
from drivers.sim.solids import Point3

Matrix3 = tuple[Point3, Point3, Point3]
"""A matrix (3, 3), row by row."""


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """Pose of a camera: position in metres, ``yaw`` about z (positive left), ``pitch`` about y (positive down)."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0

    def position(self) -> Point3:
        """Return the position (x, y, z) of the camera in metres."""
        return self.x, self.y, self.z

    def rotation(self) -> Matrix3:
        """Return the rotation matrix from world axes to camera axes; its rows are right, down and forward."""
        right = (sin(self.yaw), -cos(self.yaw), 0.0)
        down = (-sin(self.pitch) * cos(self.yaw), -sin(self.pitch) * sin(self.yaw), -cos(self.pitch))
        forward = (cos(self.pitch) * cos(self.yaw), cos(self.pitch) * sin(self.yaw), -sin(self.pitch))
        return right, down, forward

    def to_camera_axes(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """Return a point of the world, in metres, in camera axes: right, down and forward."""
        dx, dy, dz = x - self.x, y - self.y, z - self.z
        level = dx * cos(self.yaw) + dy * sin(self.yaw)
        return (
            dx * sin(self.yaw) - dy * cos(self.yaw),
            -level * sin(self.pitch) - dz * cos(self.pitch),
            level * cos(self.pitch) - dz * sin(self.pitch),
        )


def camera_viewpoint(base: Pose2D, pan: float, tilt: float, place: tuple[float, float, float]) -> Viewpoint:
    """Return the viewpoint of a camera at ``place`` on a base, on a head that is turned by ``pan`` and ``tilt``.

    ``place`` (x, y, z) in metres is relative to the middle of the base on the floor, and does not move with the head.
    """
    x, y, z = place
    ahead, aside = cos(base.heading), sin(base.heading)
    return Viewpoint(
        base.x + x * ahead - y * aside, base.y + x * aside + y * ahead, z, yaw=base.heading + pan, pitch=tilt
    )


@dataclass(frozen=True, slots=True)
class PinholeLens:
    """An ideal lens: ``width`` and ``height`` of the picture in pixels, horizontal ``field_of_view`` in radians."""

    width: int
    height: int
    field_of_view: float

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        return self.width / 2 / tan(self.field_of_view / 2)

    @property
    def half_diagonal(self) -> float:
        """Angle in radians from the optical axis to a corner of the picture."""
        return atan(hypot(self.width, self.height) / 2 / self.focal)

    def matrix(self) -> Matrix3:
        """Return the camera matrix K, from camera coordinates to homogeneous pixels."""
        f = self.focal
        return (f, 0.0, (self.width - 1) / 2), (0.0, f, (self.height - 1) / 2), (0.0, 0.0, 1.0)
