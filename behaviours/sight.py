"""Leaves that look for people: three conditions, and a search with the head."""

import math
from collections.abc import Sequence

from py_trees.common import Status

from behaviours.leaf import SUCCESS, argument
from behaviours.meeting import Meeting
from behaviours.search import Search
from behaviours.seeing import LATELY, Seeing, Seen
from drivers.api import Pose2D
from perception.api import Face


class FaceSeen(Seen[Face]):
    """Is a face in view?

    Succeeds when one was seen lately, fails when not. It never runs.
    """

    word = "face_seen"
    noun = "face"
    stores = "the face: id, yaw, pitch, distance"
    within: float = argument("duration", "how long ago still counts", default=LATELY, principal=True, low=0.01)

    @property
    def age_limit(self) -> float:
        return self.within

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()


class FacesAtLeast(Seeing[Face]):
    """Are several faces in view?

    Succeeds when so many were seen lately, fails when not. It never runs.
    """

    word = "faces_at_least"
    noun = "face"
    stores = "the faces, as a list, the largest first"
    instant = True
    number: int = argument("count", "how many", principal=True, low=1)
    within: float = argument("duration", "how long ago still counts", default=LATELY, low=0.01)

    @property
    def age_limit(self) -> float:
        return self.within

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def update(self) -> Status:
        faces = self.all_fresh()
        if len(faces) >= self.number:
            self.result = faces
            return SUCCESS
        return self.fail(f"{len(faces)} of {self.number} faces in view" if faces else self.nobody())


class FaceCentred(Seeing[Face]):
    """Is the face in the middle of the picture?

    Succeeds when the largest face, or the one that is named, is within that angle of the camera's axis, fails when
    not. It never runs.
    """

    word = "face_centred"
    noun = "face"
    stores = "the face: id, yaw, pitch, distance"
    instant = True
    within: float = argument("angle", "how far from the axis still counts", default=math.radians(5), principal=True)
    max_age: float = argument("duration", "how long ago still counts", default=LATELY, low=0.01)
    face: object = argument("value", "whose, as `as` has kept them; else the largest", default=None)

    @property
    def age_limit(self) -> float:
        return self.max_age

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def wanted(self, percept: Face) -> bool:
        only = chosen(self.face)
        return only is None or percept.id == only.id

    def update(self) -> Status:
        face = self.fresh()
        if face is None:
            return self.fail(self.nobody())
        if max(abs(face.bearing), abs(face.drop)) <= self.within:
            return self.see(face)
        return self.fail(f"the face is {math.degrees(face.bearing):+.0f}, {math.degrees(face.drop):+.0f} deg off")


class FindFace(Search[Face]):
    """Look around with the head for a face: first where it looks now, then row by row, to and fro.

    Running until a face is seen, then succeeds and the head stays on it. Fails after `scans` rounds without one; by
    default it goes on looking, so give it a `timeout`.
    """

    word = "find_face"
    noun = "face"
    stores = "the face: id, yaw, pitch, distance"
    new: bool = argument("flag", "only somebody whom it has not found before in this run", default=False)
    _met: tuple[Meeting, ...] = ()  # outlives a restart: that is what `new` is for

    def percepts(self) -> Sequence[Face]:
        return self.robot.sight.faces()

    def wanted(self, percept: Face) -> bool:
        return not self.new or not any(meeting.was_with(percept, self._stand()) for meeting in self._met)

    def see(self, percept: Face) -> Status:
        self._met += (Meeting.of(percept, self._stand()),) if self.new else ()
        return super().see(percept)

    @property
    def counts_from(self) -> float:
        """Since when a face counts: where it is must be known to tell people apart, so then the head must stand."""
        if not self.new:
            return self.since
        return math.inf if self.there_since is None else self.there_since

    def _stand(self) -> Pose2D:
        """Return where the base is, as far as there is one that tells."""
        state = None if self.robot.base_part is None else self.robot.base.state().value
        return Pose2D(0.0, 0.0, 0.0) if state is None else state.pose


def chosen(kept: object) -> Face | None:
    """Return the face that a mission names, None where it names none. Raises ValueError for what is no face."""
    if kept is None or isinstance(kept, Face):
        return kept
    raise ValueError(f"'face' needs a face that a behaviour has found, such as ${{person}}, got {kept!r}")
