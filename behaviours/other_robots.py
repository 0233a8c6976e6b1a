"""Leaves that look for other robots, by the markers that they wear: a condition, and a search with the head."""

from collections.abc import Sequence

from behaviours.head import DEFAULT_MAX_AGE, SeenLeaf
from behaviours.leaf import argument
from behaviours.search import HeadSearch
from perception.api import Marker

_OUTPUT_DOC = "the robot: id, number, name, yaw, pitch, distance, heading"
_WHICH_HELP = "its marker's number, or its name; else any"


class RobotSeenLeaf(SeenLeaf[Marker]):
    """Is another robot in view?

    `robot_seen: 7` or `robot_seen: R2`. Succeeds when its marker was seen lately, fails when not. It never
    runs; suspended while no picture is new enough to tell.
    """

    tag = "robot_seen"
    noun = "robot"
    senses = frozenset({"markers"})
    output_doc = _OUTPUT_DOC
    output_type = Marker
    which: str = argument("text", _WHICH_HELP, default="", principal=True)
    within: float = argument("duration", "how long ago still counts", default=DEFAULT_MAX_AGE, low=0.01)

    @property
    def age_limit(self) -> float:
        return self.within

    def percepts(self) -> Sequence[Marker]:
        return self.robot.sight.markers()

    def matches(self, percept: Marker) -> bool:
        return is_worn_by(percept, self.which)

    def absence_reason(self, so_far: str = "") -> str:
        return super().absence_reason(so_far or (f"robot {self.which} is not in view" if self.which else ""))


class FindRobot(HeadSearch[Marker]):
    """Look around with the head for another robot: first where it looks now, then row by row, to and fro.

    `find_robot: 7` or `find_robot: R2`. Running until its marker is seen, then succeeds and the head stays on it. Fails
    after `scans` rounds without it; by default it goes on looking, so give it a `timeout`.
    """

    tag = "find_robot"
    noun = "robot"
    senses = frozenset({"markers"})
    output_doc = _OUTPUT_DOC
    output_type = Marker
    which: str = argument("text", _WHICH_HELP, default="", principal=True)

    def percepts(self) -> Sequence[Marker]:
        return self.robot.sight.markers()

    def matches(self, percept: Marker) -> bool:
        return is_worn_by(percept, self.which)


def is_worn_by(marker: Marker, which: str) -> bool:
    """Say whether a marker is that of the robot with this number or name; of any for an empty text."""
    return which.strip() in {"", str(marker.number), marker.name}
