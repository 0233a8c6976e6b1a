"""The leaf that goes after a person: the face stays in the picture, and the person at a distance."""

import math

from behaviours.base import obstacle
from behaviours.leaf import argument
from behaviours.tracking.track_face import TrackFace
from perception.api import Percept

EAGERNESS = 0.8
"""Speed in m/s for each metre too far: with a Kobuki's dead time of 0.25 s it arrives without overshooting."""

SLACK = 0.1
"""Metres too far that are near enough: the distance is a guess from the size of the face, and trembles."""

AHEAD = math.radians(45)
"""With the head turned further aside the base only turns: it would drive past the person."""


class FollowPerson(TrackFace):
    """Follow a person: the head and the base turn to their face, and the base drives after them up to `distance`.

    Running while there is a face to follow; it never succeeds. It never drives backwards. Fails once no face was seen
    for `patience`, when it bumps into something, comes to a cliff, or a wheel drops.
    """

    word = "follow_person"
    needs = frozenset({"camera", "head", "base"})
    distance: float = argument("length", "how far to stay behind the person", default=1.0, low=0.3, high=5.0)
    speed: float = argument("speed", "how fast it may drive", default=0.3, low=0.01, high=0.7)

    def trouble(self) -> str:
        state = self.robot.base.state().value
        return "" if state is None else obstacle(state, forward=True)

    def forward(self, target: Percept, pan: float) -> float:
        too_far = target.distance - self.distance - SLACK
        # Without fresh reports neither an obstacle nor the way gone is known.
        if not too_far > 0.0 or abs(pan) >= AHEAD or not self.robot.base.state().good:  # nor does it drive by a NaN
            return 0.0
        return min(EAGERNESS * too_far, self.speed) * math.cos(pan * math.pi / 2 / AHEAD)
