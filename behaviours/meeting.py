"""Whom the robot has met, and where: so that nobody is taken for somebody new when the camera comes round again."""

import math
from typing import Self

from drivers.api import Pose2D
from drivers.api.quick import dataclass
from perception.api import UNKNOWN, Face

SAME = math.radians(15)
"""Whoever is seen this near to where somebody was met is taken for them: half a step aside at two metres."""


@dataclass(frozen=True, slots=True)
class Meeting:
    """Somebody who was met: the id of the face then, and the place (metres, odometry frame) where it was.

    ``name`` is theirs as far as the robot knew it.
    """

    id: int
    x: float
    y: float
    name: str = ""

    @classmethod
    def of(cls, face: Face, base: Pose2D) -> Self:
        """Remember ``face`` as it is seen from ``base``."""
        x, y = base.x + face.distance * math.cos(face.yaw), base.y + face.distance * math.sin(face.yaw)
        return cls(face.id, x, y, face.name)

    def was_with(self, face: Face, base: Pose2D) -> bool:
        """Say whether ``face``, seen from ``base``, is the same person's: by its id, by its name, or by where it is.

        An id is forgotten soon after its face was out of view. Two names that are known decide; else the place does,
        which lasts as far as people stay where they are.
        """
        if face.id == self.id:
            return True
        if is_known(face.name) and is_known(self.name):
            return face.name == self.name
        expected = math.atan2(self.y - base.y, self.x - base.x)
        return abs(math.remainder(face.yaw - expected, math.tau)) <= SAME


def is_known(name: str) -> bool:
    """Say whether a face's name is that of somebody: neither undecided nor unknown."""
    return name not in ("", UNKNOWN)


def is_same(face: Face, kept: Face) -> bool:
    """Say whether ``face`` is that of the person whose face was ``kept``: by id, or by a name that both have.

    A name outlasts the id, which is forgotten soon after the face was out of view.
    """
    return face.id == kept.id or (is_known(face.name) and face.name == kept.name)


def may_be(face: Face, kept: Face) -> bool:
    """Say whether ``face`` can be that of the person whose face was ``kept``: unless it is known to be another's."""
    return not (face.name and is_known(kept.name)) or face.name == kept.name
