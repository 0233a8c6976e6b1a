"""The leaf that asks whether something is near, by the range finder."""

import math

from py_trees.common import Status

from behaviours.leaf import SUCCESS, Leaf, argument
from drivers.api.measures import length_text


class ObstacleWithin(Leaf):
    """Does the range finder see something nearer than that?

    Succeeds when the newest turn of the finder has something within the distance, in a sector about straight ahead;
    fails when not. It never runs, and is suspended while there is no fresh turn. Distances are from the finder; what is
    lower than it looks, it does not see.
    """

    word = "obstacle_within"
    needs = frozenset({"range"})
    instant = True
    distance: float = argument("length", "how near", principal=True, low=0.0)
    sector: float = argument("angle", "how wide to look", default=math.radians(60), low=math.radians(2), high=math.tau)

    def update(self) -> Status:
        reading = self.robot.ranger.scan()
        if reading.value is None or not reading.good:
            return self.suspend("range finder")
        nearest = reading.value.nearest(0.0, self.sector)
        self.feedback_message = f"{length_text(nearest)} away" if math.isfinite(nearest) else "nothing in sight"
        return SUCCESS if nearest <= self.distance else self.fail(self.feedback_message)
