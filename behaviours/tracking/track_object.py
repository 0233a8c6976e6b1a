"""The leaf that keeps a coloured object in the middle of the picture."""

from collections.abc import Sequence

from behaviours.leaf import argument
from behaviours.search import named
from behaviours.tracking.track import Track
from perception.api import Thing, Wanted


class TrackObject(Track):
    """Follow a coloured object with the head, and turn the base when the head nears its limit.

    `track_object: red ball`. Running while there is one to follow; it never succeeds. Fails once none was seen for
    `patience`. Once it follows one it stays with that, whatever else of the kind comes into view, until it is lost.
    """

    word = "track_object"
    noun = "object"
    senses = frozenset({"things"})
    stores = "the object: id, name, colour, shape, yaw, pitch, distance"
    keeps = Thing
    what: Wanted = argument("object", "a colour and a shape, or the name of an object", principal=True)

    def percepts(self) -> Sequence[Thing]:
        return named(self.robot.sight.things(), self.what)
