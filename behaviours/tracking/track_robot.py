"""The leaf that keeps another robot in the middle of the picture, by the marker that it wears."""

from collections.abc import Sequence

from behaviours.leaf import argument
from behaviours.robots import worn_by
from behaviours.tracking.track import Track
from perception.api import Marker


class TrackRobot(Track):
    """Follow another robot with the head, and turn the base when the head nears its limit.

    `track_robot: 7` or `track_robot: R2`. Running while its marker is seen; it never succeeds. Fails once it was not
    seen for `patience`.
    """

    word = "track_robot"
    noun = "robot"
    senses = frozenset({"markers"})
    stores = "the robot: id, number, name, yaw, pitch, distance, heading"
    keeps = Marker
    which: str = argument("text", "its marker's number, or its name; else any", default="", principal=True)

    def percepts(self) -> Sequence[Marker]:
        return [marker for marker in self.robot.sight.markers() if worn_by(marker, self.which)]
