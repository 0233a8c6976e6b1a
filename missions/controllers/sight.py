"""The eyes of a trial: one face, measured in pixels with noise, and filtered over time as perception does it."""

from math import radians
from random import Random

from missions.assembly.seeing import Flaws
from perception.api import Box, Face, Gaze, Marker, Scene, Thing
from perception.geometry import FACE_WIDTH, Pinhole
from perception.motion import Motion

NOISE = Flaws().noise
"""Pixels by which a found face is off, one sigma: as in simulations whose eyes know the truth."""

DISTANCE = 1.5
"""Metres to the face."""

LENS = Pinhole(640, 480, radians(60))
"""What the camera sees through."""


class FilteredSight:
    """A ``perception.api.Sight`` of one face, whose noise is drawn from ``random``."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._motion: Motion | None = None
        self._face: Face | None = None

    def faces(self) -> tuple[Face, ...]:
        """The face, as the newest picture showed it."""
        return () if self._face is None else (self._face,)

    def things(self) -> tuple[Thing, ...]:
        """Nothing else."""
        return ()

    def markers(self) -> tuple[Marker, ...]:
        """Nothing else."""
        return ()

    def looked(self) -> float | None:
        """The stamp of the newest picture."""
        return None if self._face is None else self._face.stamp

    def scene(self) -> Scene | None:
        """Not measured."""
        return None

    def measure(self, bearing: float) -> Box | None:
        """Return where the face is in a picture; None where it is not wholly inside."""
        if not abs(bearing) < LENS.field_of_view / 2:
            return None
        x, y = LENS.pixel(bearing, 0.0)
        x, y = x + self._random.gauss(0.0, NOISE), y + self._random.gauss(0.0, NOISE)
        half = FACE_WIDTH * LENS.focal / DISTANCE / 2
        return Box(x - half, y - half, 2 * half, 2 * half) if half <= x <= LENS.width - half else None

    def see(self, stamp: float, box: Box, gaze: Gaze) -> None:
        """Take in what a picture shows."""
        bearing, drop = LENS.angles(*box.centre)
        yaw = gaze.yaw + bearing
        if self._motion is None or self._face is None:
            self._motion = Motion(yaw)
        else:
            self._motion.update(yaw, stamp - self._face.stamp)
        motion = self._motion
        self._face = Face(1, stamp, box, bearing, drop, motion.angle, gaze.pitch + drop, motion.rate, 0.0, DISTANCE)
