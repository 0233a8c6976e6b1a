"""The eyes of a trial: faces, measured in pixels with noise, and filtered over time as perception does it."""

from collections.abc import Callable, Sequence
from math import radians
from random import Random

import numpy as np

from missions.assembly.seeing import SensorNoise
from perception.api import Box, Face, Gaze, View
from perception.delay import GRID, Delay, Floats
from perception.eyes import NewestView
from perception.geometry import FACE_WIDTH, Pinhole
from perception.tracks import Motion

NOISE = SensorNoise().noise
"""Pixels by which a found face is off, one sigma: as in simulations whose eyes know the truth."""

DISTANCE = 1.5
"""Metres to the face."""

LENS = Pinhole(640, 480, radians(60))
"""What the camera sees through."""


GONE = 1.0
"""Seconds after which a face that was not seen is forgotten."""

GATE = radians(20)
"""A face this far (radians) from where each of those before is expected is another one."""

FLOW_NOISE = radians(0.1)
"""Radians by which the background tells a turn of the camera wrongly, one sigma: as measured on rendered rooms."""


class FilteredSight(NewestView):
    """Faces, measured with noise that is drawn from ``random``; and how late the camera stamps them, learnt.

    ``gaze(time)`` is where the robot believes that its camera looked.
    """

    def __init__(self, random: Random, gaze: Callable[[float], Gaze]) -> None:
        self.delay = Delay()
        self._random = random
        self._gaze = gaze
        self._followed: dict[int, tuple[Motion, Face]] = {}
        self._ids = 0
        self._before: tuple[float, Floats] | None = None
        self._last = self._looked = 0.0

    def measure(self, bearing: float) -> Box | None:
        """Return where a face is in a picture; None where it is not wholly inside."""
        if not abs(bearing) < LENS.field_of_view / 2:
            return None
        x, y = LENS.pixel(bearing, 0.0)
        x, y = x + self._random.gauss(0.0, NOISE), y + self._random.gauss(0.0, NOISE)
        half = FACE_WIDTH * LENS.focal / DISTANCE / 2
        return Box(x - half, y - half, 2 * half, 2 * half) if half <= x <= LENS.width - half else None

    def see(self, stamp: float, boxes: Sequence[Box], looked: float) -> None:
        """Take in what a picture shows that was stamped ``stamp``; ``looked`` is where the camera truly looked."""
        yaws = np.array([self._gaze(stamp - delay).yaw for delay in GRID])
        if self._before is not None:
            turned = looked - self._before[0] + self._random.gauss(0.0, FLOW_NOISE)
            self.delay.learn(turned, yaws - self._before[1])
        self._before = looked, yaws
        self._last = stamp = max(stamp - self.delay.seconds, self._last + 0.001)
        gaze = self._gaze(stamp)
        for box in boxes:
            self._follow(stamp, box, gaze, alone=len(boxes) == 1)
        self._looked = gaze.yaw
        faces = (face for _, face in self._followed.values() if stamp - face.stamp < GONE)
        self._view = View(looked=stamp, faces=tuple(faces))

    def _follow(self, stamp: float, box: Box, gaze: Gaze, *, alone: bool) -> None:
        """Take a face for the one before that is nearest to where it is expected, or for a new one."""
        bearing, elevation = LENS.angles(*box.centre)
        yaw = gaze.yaw + bearing
        offs = {
            number: abs(face.predict(stamp)[0] - yaw)
            for number, (_, face) in self._followed.items()
            if face.stamp < stamp and stamp - face.stamp < GONE
        }
        number = min(offs, key=lambda number: offs[number], default=0)
        if number and offs[number] < GATE:
            motion, before = self._followed[number]
            motion.update(yaw, stamp - before.stamp, abs(gaze.yaw - self._looked))
        else:
            if alone:  # it has jumped; nobody is where it was
                self._followed.clear()
            self._ids = number = self._ids + 1
            motion = Motion(yaw)
        pitch = gaze.pitch + elevation
        face = Face(number, stamp, box, bearing, elevation, motion.angle, pitch, motion.rate, 0.0, DISTANCE)
        self._followed[number] = motion, face
