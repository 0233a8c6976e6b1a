"""Leaves that look for coloured things: a condition, and a search with the head."""

from collections.abc import Sequence

from behaviours.leaf import argument
from behaviours.search import Search
from behaviours.seeing import LATELY, Seen
from perception.api import Thing, Wanted

_STORED = "the object: id, name, colour, shape, yaw, pitch, distance"


class ObjectSeen(Seen[Thing]):
    """Is a coloured object in view?

    `object_seen: red ball`. Succeeds when one was seen lately, fails when not. It never runs. It is
    suspended while no picture is new enough to tell.
    """

    word = "object_seen"
    senses = frozenset({"things"})
    stores = _STORED
    keeps = Thing
    what: Wanted = argument("object", "a colour and a shape, or the name of an object", principal=True)
    within: float = argument("duration", "how long ago still counts", default=LATELY, low=0.01)

    @property
    def age_limit(self) -> float:
        return self.within

    def percepts(self) -> Sequence[Thing]:
        return named(self.robot.sight.things(), self.what)

    def nobody(self, so_far: str = "") -> str:
        return super().nobody(so_far or f"no {self.what.name} in view")


class FindObject(Search[Thing]):
    """Look around with the head for a coloured object: first where it looks now, then row by row, to and fro.

    `find_object: red ball`. Running until one is seen, then succeeds and the head stays on it. Fails after `scans`
    rounds without one; by default it goes on looking, so give it a `timeout`.
    """

    word = "find_object"
    noun = "object"
    senses = frozenset({"things"})
    stores = _STORED
    keeps = Thing
    what: Wanted = argument("object", "a colour and a shape, or the name of an object", principal=True)

    def percepts(self) -> Sequence[Thing]:
        return named(self.robot.sight.things(), self.what)


def named(things: Sequence[Thing], wanted: Wanted) -> list[Thing]:
    """Return those of ``things`` that were looked for by that name."""
    return [thing for thing in things if thing.name == wanted.name]
