"""Leaves that detect other robots by their markers: a condition, and a search with the head."""

from collections.abc import Sequence

from behaviours.head import DEFAULT_MAX_AGE, SeenLeaf
from behaviours.leaf import argument
from behaviours.search import HeadSearch
from perception.api import Marker

_OUTPUT_DOC = "the robot: id, number, name, yaw, pitch, distance, heading"
_WHICH_HELP = "number of its marker, or its name; any robot by default"


class RobotSeenLeaf(SeenLeaf[Marker]):
    """Check whether another robot is in view.

    `robot_seen: 7` or `robot_seen: R2`. Succeeds if its marker was seen within the last `within` seconds, fails if not.
    It answers at once, and is suspended while no picture is recent enough.
    """

    tag = "robot_seen"
    example = "- robot_seen: 7"
    noun = "robot"
    senses = frozenset({"markers"})
    output_doc = _OUTPUT_DOC
    output_type = Marker
    which: str = argument("text", _WHICH_HELP, default="", principal=True)
    within: float = argument("duration", "maximum age of the sighting", default=DEFAULT_MAX_AGE, low=0.01)

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
    """Search for another robot with the head: first straight at the present pose, then row by row, back and forth.

    `find_robot: 7` or `find_robot: R2`. Running until its marker is seen; then it succeeds and the head stays on it.
    Fails after `scans` rounds without it. By default it searches for ever, so give it a `timeout`.
    """

    tag = "find_robot"
    example = "- find_robot: {which: 7, scans: 2}"
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
    """Return True if the robot with this number or name wears the marker; always True for an empty text."""
    return which.strip() in {"", str(marker.number), marker.name}
