"""Whom the robot has met, and where: so that nobody is taken for somebody new when the camera comes round again."""

import math
from dataclasses import dataclass
from typing import Self

from drivers.api import Pose2D
from perception.api import Face

SAME = math.radians(15)
"""Whoever is seen this near to where somebody was met is taken for them: half a step aside at two metres."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Somebody who was met: the id of the face then, and the place (metres, odometry frame) where it was."""

    id: int
    x: float
    y: float

    @classmethod
    def of(cls, face: Face, base: Pose2D) -> Self:
        """Remember ``face`` as it is seen from ``base``."""
        return cls(face.id, base.x + face.distance * math.cos(face.yaw), base.y + face.distance * math.sin(face.yaw))

    def was_with(self, face: Face, base: Pose2D) -> bool:
        """Say whether ``face``, seen from ``base``, is the same person's: by its id, or by where it is.

        An id is forgotten soon after its face was out of view; the place lasts, as far as people stay where they are.
        """
        expected = math.atan2(self.y - base.y, self.x - base.x)
        return face.id == self.id or abs(math.remainder(face.yaw - expected, math.tau)) <= SAME
