"""The leaf that keeps a face in the middle of the picture."""

from collections.abc import Sequence

from behaviours.leaf import argument
from behaviours.sight import KEPT, chosen, may_be
from behaviours.tracking.rules import RuleBases
from behaviours.tracking.track import Track
from perception.api import Face, Percept


class TrackFace(Track):
    """Follow a face with the head, and turn the base when the head nears its limit.

    Running while there is a face to follow; it never succeeds. Fails once none was seen for `patience`.
    Once it follows somebody it stays with them, whoever else comes into view, until that face is lost; and then it
    takes up nobody who is known to be another.
    """

    word = "track_face"
    noun = "face"
    stores = KEPT
    keeps = Face
    controller: RuleBases = argument("controller", "the rules to follow by", default="face", principal=True)
    face: Face | None = argument(
        "face", "whom to begin with, as `as` has kept them; else the largest face", default=None
    )

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def begins_with(self) -> Face | None:
        return chosen(self.face)

    def may_be(self, percept: Percept, target: Percept) -> bool:
        return not (isinstance(percept, Face) and isinstance(target, Face)) or may_be(percept, target)
