"""The leaf that makes out who somebody is."""

from collections.abc import Sequence

from py_trees.common import Status

from behaviours.head import LATELY, Seeing
from behaviours.leaf import argument
from behaviours.sight import KEPT, chosen, is_same
from perception.api import Face

GONE = 1.0
"""Seconds without the face after which it gives up: as long as a face keeps its id out of view."""


class Identify(Seeing[Face]):
    """Make out who somebody is, by their face.

    Running until that is decided, then succeeds; `name` of what it keeps is a name that the robot knows, or `unknown`.
    Fails once no such face was in view for a second.
    """

    word = "identify"
    noun = "face"
    senses = frozenset({"faces", "names"})
    stores = KEPT
    keeps = Face
    face: Face | None = argument("face", "whose, as `as` has kept them; else the largest", default=None, principal=True)
    _seen_at = 0.0

    @property
    def age_limit(self) -> float:
        return LATELY

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def wanted(self, percept: Face) -> bool:
        only = chosen(self.face)
        return only is None or is_same(percept, only)

    def initialise(self) -> None:
        self._seen_at = self.run.now()

    def update(self) -> Status:
        face = self.fresh()
        now = self.run.now()
        if face is None:
            gone = now - self._seen_at > GONE
            return self.fail(self.nobody()) if gone else self.wait(self.nobody())
        if face.name:
            return self.see(face)
        self._seen_at = now
        return self.wait("not decided yet who that is")
