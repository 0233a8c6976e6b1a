"""From pixels to directions: the pinhole camera, and where it looks.

Directions are two angles, as of a head that first pans and then tilts: left about z, then down from the horizon of
whoever looks. So ``look`` at gaze zero changes nothing, and each pair of angles turns into a unit vector (x forward,
y left, z up, REP 103) as (cos down cos left, cos down sin left, -sin down).
"""

from dataclasses import dataclass
from math import atan2, cos, hypot, isfinite, pi, remainder, sin, tan, tau

from perception.api import Box, Gaze

FACE_WIDTH = 0.17
"""Metres of face in the width of a Haar box.

Measured on three portraits as the box's width over the distance between the pupils, 0.063 m in the mean adult: 0.184,
0.178 and 0.144 m. Expect a distance formed with it to be off by 20 %.
"""


def wrap(angle: float) -> float:
    """Return the same direction within -pi..pi."""
    return remainder(angle, tau)


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A camera without distortion: its picture in pixels, and the horizontal angle of view in radians.

    Raises ValueError for a picture without pixels or an angle that is not between 0 and pi.
    """

    width: int
    height: int
    field_of_view: float

    def __post_init__(self) -> None:
        if self.width <= 0 or self.height <= 0:
            raise ValueError(f"camera: a picture of {self.width}x{self.height} pixels cannot be")
        if not 0 < self.field_of_view < pi:
            raise ValueError(f"camera: the angle of view must be between 0 and pi rad, not {self.field_of_view}")

    @property
    def focal(self) -> float:
        """The focal length in pixels."""
        return self.width / 2 / tan(self.field_of_view / 2)

    def angles(self, x: float, y: float) -> tuple[float, float]:
        """Return the (bearing, drop) of a pixel from the optical axis, in radians, left and down positive."""
        left, down = self.width / 2 - x, y - self.height / 2
        return atan2(left, self.focal), atan2(down, hypot(left, self.focal))

    def pixel(self, bearing: float, drop: float) -> tuple[float, float]:
        """Return the pixel (x, y) of a direction; it may lie outside the picture.

        Raises ValueError for a direction that is not in front of the camera.
        """
        if not (abs(bearing) < pi / 2 and abs(drop) < pi / 2):
            raise ValueError(f"camera: {bearing:.3f} rad left, {drop:.3f} rad down is not in front of it")
        left = self.focal * tan(bearing)
        return self.width / 2 - left, self.height / 2 + tan(drop) * hypot(left, self.focal)

    def distance(self, face: Box) -> float:
        """Guess how far away a face is, in metres, from the width of its Haar box. Raises ValueError for no width."""
        if not (isfinite(face.width) and face.width > 0):
            raise ValueError(f"camera: a face {face.width} pixels wide has no distance")
        return FACE_WIDTH * self.focal / face.width


def look(gaze: Gaze, bearing: float, drop: float) -> tuple[float, float]:
    """Return the (yaw, pitch) of what a camera with this gaze sees at ``bearing`` and ``drop``.

    Exact: the direction is turned by the gaze's pitch about y, then by its yaw about z. Plain addition is 1.7 degrees
    off where both the tilt and the bearing are 20 degrees. The yaw is not wrapped: it goes on as the gaze's does.
    """
    forward, left, up = cos(drop) * cos(bearing), cos(drop) * sin(bearing), -sin(drop)
    level = forward * cos(gaze.pitch) + up * sin(gaze.pitch)
    height = up * cos(gaze.pitch) - forward * sin(gaze.pitch)
    return gaze.yaw + atan2(left, level), atan2(-height, hypot(level, left))
