"""Pinhole camera: conversion between pixels and directions.

Directions are two angles, as of a head that first pans and then tilts: left about z, then down from the horizon of the
observer. A pair of angles is the unit vector (cos down cos left, cos down sin left, -sin down), with x forward, y left,
z up (REP 103). For a camera that looks straight ahead, ``direction_of`` returns the angles unchanged.
"""

from math import atan2, cos, hypot, isfinite, pi, remainder, sin, tan, tau

from drivers.api.fast_dataclass import dataclass
from perception.api import Box, Gaze

FACE_WIDTH = 0.17
"""Width in metres that the box of a Haar face detector has at the distance of the face.

It was measured on three portraits: the width of the box divided by the distance between the pupils, times 0.063 m,
which is the distance between the pupils of an average adult. The results were 0.184, 0.178 and 0.144 m, so a distance
computed with this width may be wrong by 20 %.
"""

UNDISTORT_ITERATIONS = 12
"""Iterations that undo the distortion: to a hundredth of a pixel in the corners of a webcam's picture."""


def wrap_angle(angle: float) -> float:
    """Return the angle of the same direction within -pi..pi."""
    return remainder(angle, tau)


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A camera: size of its picture in pixels, and horizontal angle of view in radians.

    ``centre`` is the optical axis in the picture, as shares of width and height. ``distortion`` is empty, or (k1, k2,
    p1, p2, k3) as in OpenCV's calibration: Brown's model, radial and tangential. Raises ValueError for a picture
    without pixels, an angle outside 0..pi, a centre outside the picture, or another number of coefficients.
    """

    width: int
    height: int
    field_of_view: float
    centre: tuple[float, float] = (0.5, 0.5)
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.width <= 0 or self.height <= 0:
            raise ValueError(f"camera: a picture of {self.width}x{self.height} pixels is impossible")
        if not 0 < self.field_of_view < pi:
            raise ValueError(f"camera: the angle of view must be between 0 and pi rad, not {self.field_of_view}")
        if not all(0 < share < 1 for share in self.centre):
            raise ValueError(f"camera: the centre must lie in the picture, not at {self.centre} of its sides")
        if len(self.distortion) not in (0, 5):
            raise ValueError(f"camera: the distortion is k1, k2, p1, p2, k3, not {len(self.distortion)} numbers")

    @property
    def focal(self) -> float:
        """Focal length of the camera in pixels."""
        return self.width / 2 / tan(self.field_of_view / 2)

    def pixel_to_angles(self, x: float, y: float) -> tuple[float, float]:
        """Return (bearing, elevation) of a pixel from the optical axis, in radians, left and down positive."""
        right = (x - self.centre[0] * self.width) / self.focal
        down = (y - self.centre[1] * self.height) / self.focal
        if self.distortion:
            right, down = self._undistort(right, down)
        return atan2(-right, 1.0), atan2(down, hypot(right, 1.0))

    def angles_to_pixel(self, bearing: float, elevation: float) -> tuple[float, float]:
        """Return the pixel (x, y) of a direction; it may lie outside the picture.

        Raises ValueError for a direction that is not in front of the camera.
        """
        if not (abs(bearing) < pi / 2 and abs(elevation) < pi / 2):
            raise ValueError(f"camera: {bearing:.3f} rad left, {elevation:.3f} rad down is not in front of it")
        right = -tan(bearing)
        down = tan(elevation) * hypot(right, 1.0)
        if self.distortion:
            right, down = self._distort(right, down)
        return self.centre[0] * self.width + self.focal * right, self.centre[1] * self.height + self.focal * down

    def _distort(self, x: float, y: float) -> tuple[float, float]:
        """Return the position in the distorted picture of the point (x, y) of the undistorted picture.

        Both are distances from the optical axis, in focal lengths.
        """
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def _undistort(self, x: float, y: float) -> tuple[float, float]:
        """Invert ``_distort`` by fixed-point iteration, which converges for ordinary lenses."""
        true_x, true_y = x, y
        for _ in range(UNDISTORT_ITERATIONS):
            bent_x, bent_y = self._distort(true_x, true_y)
            true_x, true_y = true_x + x - bent_x, true_y + y - bent_y
        return true_x, true_y

    def face_distance(self, face: Box) -> float:
        """Return the distance of a face in metres, estimated from its box. Raises ValueError for a box of no width."""
        if not (isfinite(face.width) and face.width > 0):
            raise ValueError(f"camera: a face {face.width} pixels wide has no distance")
        return FACE_WIDTH * self.focal / face.width


def direction_of(gaze: Gaze, bearing: float, elevation: float) -> tuple[float, float]:
    """Return (yaw, pitch) of an object at ``bearing`` and ``elevation`` from a camera with this gaze.

    Exact: the direction is rotated by the gaze's pitch about y, then by its yaw about z. Plain addition is 1.7 degrees
    off if both the tilt and the bearing are 20 degrees. The yaw is not wrapped: it continues that of the gaze.
    """
    forward, left, up = cos(elevation) * cos(bearing), cos(elevation) * sin(bearing), -sin(elevation)
    level = forward * cos(gaze.pitch) + up * sin(gaze.pitch)
    height = up * cos(gaze.pitch) - forward * sin(gaze.pitch)
    return gaze.yaw + atan2(left, level), atan2(-height, hypot(level, left))
