"""The eyes of a trial: faces, measured in pixels with noise, and filtered over time as perception does it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import radians
from random import Random

import numpy as np

from missions.assembly.seeing import SensorNoise
from perception.api import Box, Face, Gaze, View
from perception.delay import Delay
from perception.delay_grid import GRID, Floats, find_unrecorded
from perception.exposure_clock import ExposureClock
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

    ``gaze(time)`` is where the robot believes that its camera looked. ``now`` tells the time.
    """

    def __init__(self, random: Random, gaze: Callable[[float], Gaze], now: Callable[[], float]) -> None:
        self.delay = Delay()
        self._random = random
        self._gaze = gaze
        self._now = now
        self._followed: dict[int, tuple[Motion, Face]] = {}
        self._ids = 0
        self._before: tuple[float, Floats] | None = None
        self._clock = ExposureClock()
        self._looked = 0.0

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
        times = stamp - GRID
        yaws = np.array([self._gaze(time).yaw for time in times])
        if self._before is None:
            self.delay.begin(yaws)
        else:
            turned = looked - self._before[0] + self._random.gauss(0.0, FLOW_NOISE)
            unrecorded = find_unrecorded(yaws, self._gaze(times[0] + 1.0).yaw, times, self._now())
            self.delay.learn(turned, yaws - self._before[1], yaws, unrecorded)
        self._before = looked, yaws
        exposure = self._clock.expose(stamp, self.delay.seconds, self._now())
        stamp, gaze = exposure.stamp, self._gaze(exposure.time)
        gaze = replace(gaze, doubt=max(exposure.doubt, self.delay.doubt))
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
            motion.update(yaw, stamp - before.stamp, abs(gaze.yaw - self._looked), gaze.doubt)
        else:
            if alone:  # it has jumped; nobody is where it was
                self._followed.clear()
            self._ids = number = self._ids + 1
            motion = Motion(yaw)
        pitch = gaze.pitch + elevation
        face = Face(number, stamp, box, bearing, elevation, motion.angle, pitch, motion.rate, 0.0, DISTANCE)
        self._followed[number] = motion, face
